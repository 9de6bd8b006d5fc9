#pragma once
// One edge collapse: is it legal, where does the vertex go, and the surgery.

#include <array>
#include <cstdint>

#include "simplify/position_set.h"
#include "simplify/working_mesh.h"

namespace pietra {

/// Vertices whose fans have more corners together are left alone: keeps every collapse cheap.
inline constexpr uint32_t kMaxRing = 256;

/// Where new vertices may lie, relative to the mesh's centre.
struct SnapGrid {
    float step = 1, inverse_step = 1;
    Vec3f low{0, 0, 0}, high{0, 0, 0};

    Vec3f snap(const Vec3f& p) const {
        const Vec3f r{std::floor(p.x * inverse_step + 0.5f) * step,
                      std::floor(p.y * inverse_step + 0.5f) * step,
                      std::floor(p.z * inverse_step + 0.5f) * step};
        return glm::max(low, glm::min(high, r));
    }
};

/// The best place for the vertex that edge (u, v) becomes, and the quadrics' value there.
struct Placement {
    Vec3f position;
    float cost;
};

/// Ignores everything but ranks and quadrics. Not both may be fixed.
Placement placeEdge(const WorkingMesh& mesh, uint32_t u, uint32_t v, const SnapGrid& grid);

/// True if the edge that starts at corner `k` of `face` may be collapsed as far as ranks go.
inline bool collapsibleEdge(const WorkingMesh& mesh, const Face& face, uint32_t k) {
    const uint32_t a = mesh.point[face.v[k]].rank();
    const uint32_t b = mesh.point[face.v[kNextCorner[k]]].rank();
    if (a == kRankFree || b == kRankFree) return true;
    return a + b < 2 * kRankFixed && face.edgeClass(k) != EdgeClass::kManifold;
}

/// What remains of a fan when the triangles on the collapsing edge are gone.
struct Ring {
    uint32_t size = 0;
    std::array<uint32_t, kMaxRing> corner, next, previous;
};

/// A triangle on the collapsing edge (u, v): it dies, and its edges to `vertex` become one.
struct Wing {
    uint32_t face;
    uint32_t vertex;
    EdgeClass to_u, to_v;
    EdgeClass merged;
};

/// Tests and performs collapses; holds the walks' scratch.
class Collapser {
public:
    Collapser(WorkingMesh& mesh, PositionSet& positions) : mesh_(mesh), positions_(positions) {}

    /// Collapses edge (u, v), both alive, if all rules allow it. Returns the vertex that remains
    /// (one of the two), or kNoVertex. Merges positions, quadrics, fans and classes;
    /// `fraction`: how far along the edge, from the removed vertex to the remaining one, it now
    /// lies.
    uint32_t tryCollapse(uint32_t u, uint32_t v, const SnapGrid& grid);

    static constexpr uint32_t kNoVertex = 0xffffffffu;
    uint32_t removed() const { return removed_; }
    const Placement& placement() const { return placement_; }
    /// The fan of the vertex that remains.
    const Ring& removedRing() const { return ring_[0]; }
    const Ring& keptRing() const { return ring_[1]; }

private:
    void findWings(uint32_t u, uint32_t v);
    bool quotaAllows() const;
    bool mergeWingClasses(const Point& u, const Point& v);
    void readRing(uint32_t v, uint32_t other, Ring& ring);
    bool linksAllow();
    bool makesOuterEdge() const;
    bool keepsShape(const Ring& ring, const Vec3f& from, const Vec3f& to) const;
    void apply(uint32_t u, uint32_t v);
    void writeFan(uint32_t v);

    WorkingMesh& mesh_;
    PositionSet& positions_;
    std::array<Ring, 2> ring_;
    std::array<Wing, 3> wing_;
    uint32_t wing_count_ = 0;
    Placement placement_{};
    uint32_t removed_ = kNoVertex;
};

}  // namespace pietra
