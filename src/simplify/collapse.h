#pragma once
// One edge collapse: is it legal, where does the vertex go, and the surgery.

#include <array>
#include <cstdint>
#include <span>

#include "simplify/edge_kernels.h"
#include "simplify/position_set.h"
#include "simplify/working_mesh.h"

namespace pietra {

/// Vertices whose fans have more corners together are left alone: keeps every collapse cheap.
inline constexpr uint32_t kMaxRing = 256;

/// True if the edge that starts at corner `k` of `face` may be collapsed as far as ranks go.
inline bool collapsibleEdge(const WorkingMesh& mesh, const Face& face, uint32_t k) {
    const uint32_t a = mesh.point[face.v[k]].rank();
    const uint32_t b = mesh.point[face.v[kNextCorner[k]]].rank();
    if (a == kRankFree || b == kRankFree) return true;
    return a + b < 2 * kRankFixed && face.edgeClass(k) != EdgeClass::kManifold;
}

/// The triangles that remain around both ends of the collapsing edge: those of u, then those of v.
struct Ring {
    uint32_t size = 0;    ///< of both
    uint32_t size_u = 0;  ///< those of u
    std::array<uint32_t, kMaxRing + kFoldBatch> corner, apex, next, previous;
};

/// A triangle on the collapsing edge (u, v): it dies, and its edges to `vertex` become one.
struct Wing {
    uint32_t face;
    uint32_t vertex;
    EdgeClass to_u, to_v;
    EdgeClass merged;
};

inline constexpr uint32_t kMaxWings = 3;

/// Tests and performs collapses; holds the walks' scratch.
class Collapser {
public:
    Collapser(WorkingMesh& mesh, PositionSet& positions)
        : mesh_(mesh), positions_(positions), kernels_(chooseEdgeKernels()) {}

    /// True if all rules allow edge (u, v), both alive, to collapse to `to`. v is to remain, and
    /// must not be of lower rank.
    bool allows(uint32_t u, uint32_t v, const Vec3f& to);

    /// Of the collapse just allowed: how far what the ends stand for may lie from the triangles
    /// around the new vertex. An end's old place is measured, what it had before is added.
    float deviation(uint32_t u, uint32_t v, const Vec3f& to) const;

    /// Performs the collapse just allowed. Merges positions, fans and classes, not quadrics.
    void apply(uint32_t u, uint32_t v, const Vec3f& to);

    /// If true, triangles of cells that have reached their quotas may die, too.
    void setFree(bool free) { free_ = free; }

    /// Triangles below this shape, at most kMinShape, must not become worse than they are.
    void setMinShape(float shape) { min_shape_ = shape; }

    /// After a collapse: the triangles around the vertex that remains, with its neighbours.
    const Ring& ring() const { return ring_; }
    /// Of the collapse just allowed.
    std::span<const Wing> wings() const { return {wing_.data(), wing_count_}; }

private:
    bool readFirstRing(uint32_t u, uint32_t v);
    bool readSecondRing(uint32_t v, uint32_t u);
    bool wingsAllow(const Point& u, const Point& v);
    bool facesMeet(uint32_t a, uint32_t b) const;
    bool makesOuterEdge() const;
    bool keepsShapes(uint32_t count, const Vec3f& to);
    bool keepsShape(uint32_t i, const Vec3f& to) const;
    void setClassOfEdgesTo(uint32_t w, EdgeClass c);
    void writeFan(uint32_t v);

    WorkingMesh& mesh_;
    PositionSet& positions_;
    EdgeKernels kernels_;
    Ring ring_;
    std::array<Wing, kMaxWings + 1> wing_;
    uint32_t wing_count_ = 0;
    float min_shape_ = kMinShape;
    bool free_ = false;
};

}  // namespace pietra
