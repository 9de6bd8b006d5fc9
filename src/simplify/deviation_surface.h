#pragma once
// A mesh prepared for the deviation bound: neighbours, unit normals, and a search for the nearest
// face. Owned by Deviation; rebuilt for every call without allocating once its arrays are large
// enough.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "simplify/lanes4.h"
#include "simplify/triangle_distance.h"

namespace pietra::deviation {

inline constexpr uint32_t kNone = ~0u;

/// A face and one of its edges: edge k joins corners k and (k+1)%3.
struct HalfEdge {
    uint32_t bits = kNone;
    HalfEdge() = default;
    HalfEdge(uint32_t face, uint32_t edge) : bits(face << 2 | edge) {}
    uint32_t face() const { return bits >> 2; }
    uint32_t edge() const { return bits & 3; }
    bool exists() const { return bits != kNone; }
};

inline constexpr uint32_t nextCorner(uint32_t k) {
    return k == 2 ? 0 : k + 1;
}

class Surface {
public:
    struct alignas(16) Vertex {
        std::array<float, 4> xyz0;  ///< lattice coordinates fit a float
    };
    struct alignas(16) Face {
        Vec3f normal;            ///< unit; zero where the face has no area
        float inverse_area = 0;  ///< 1 / (twice the area); zero where it has none
        std::array<uint32_t, 3> vertex;
        /// What lies across each edge: one that exists runs the other way round, as consistent
        /// winding has it. Missing at borders and where other than two faces meet.
        std::array<HalfEdge, 3> opposite;

        Lanes4 normalLanes() const { return Lanes4{normal.x, normal.y, normal.z, 0}; }
    };

    void assign(const Mesh& mesh);

    uint32_t faceCount() const { return uint32_t(face_.size()); }
    uint32_t vertexCount() const { return uint32_t(vertex_.size()); }
    const Face& face(uint32_t f) const { return face_[f]; }
    const Vertex& vertex(uint32_t v) const { return vertex_[v]; }
    Vec3f position(uint32_t v) const {
        const auto& p = vertex_[v].xyz0;
        return {p[0], p[1], p[2]};
    }
    Vec3f corner(uint32_t f, int k) const { return position(face_[f].vertex[k]); }
    /// Some face at a vertex, kNone if there is none.
    uint32_t faceAt(uint32_t v) const { return face_at_[v]; }

    /// The face in coordinates relative to `origin`, a lattice point: exact.
    LocalTriangle local(uint32_t f, const Vec3f& origin) const {
        return {corner(f, 0) - origin, corner(f, 1) - origin, corner(f, 2) - origin,
                face_[f].normal};
    }

    struct Nearest {
        uint32_t face = kNone;
        float value = 0;  ///< distance + offset of the face
    };
    /// The face with the smallest distance to `origin + p`, plus `offset[face]` where `offset` is
    /// not empty (offsets are not negative); exact but for rounding. Only values below
    /// `start.value` count; without any, `start` returns.
    Nearest nearest(const Vec3f& origin, const Vec3f& p, std::span<const float> offset,
                    Nearest start) const;

private:
    struct Block {
        Vec3f min, max;
    };
    void linkNeighbours();
    void computeNormals();
    void buildBlocks() const;

    std::vector<Vertex> vertex_;
    std::vector<Face> face_;
    std::vector<uint32_t> face_at_;
    struct Link {
        uint32_t upper;  ///< the higher vertex
        HalfEdge half_edge;
        uint32_t next;
        bool ascending;
        bool taken;
    };
    std::vector<uint32_t> first_link_;  ///< scratch: half-edges listed by their lower vertex
    std::vector<Link> link_;
    void searchBlock(size_t level, uint32_t block, const Vec3f& origin, const Vec3f& p,
                     std::span<const float> offset, Nearest& best) const;
    /// A tree of boxes, made when first asked for: runs of faces, then runs of boxes. Faces come in
    /// the order of the curve, so runs are compact.
    mutable std::vector<std::vector<Block>> blocks_;
    mutable bool blocks_valid_ = false;
};

}  // namespace pietra::deviation
