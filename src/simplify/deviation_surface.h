#pragma once
// A mesh prepared for the deviation bound: neighbours, unit normals, and a search for the nearest
// face. Owned by Deviation; rebuilt for every call without allocating once its arrays are large
// enough.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "geometry/triangle_distance.h"
#include "simplify/lanes4.h"

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
    return 9u >> (2 * k) & 3;  // 1, 2, 0 without a branch
}

class Surface {
public:
    struct alignas(16) Vertex {
        std::array<float, 4> lanes;  ///< 0, x, y, z: lattice coordinates fit a float
    };
    struct alignas(16) Face {
        /// 1 / (twice the area), unit normal; all zero where the face has no area
        std::array<float, 4> area_normal;
        std::array<uint32_t, 3> vertex;
        /// What lies across each edge: one that exists runs the other way round, as consistent
        /// winding has it. Missing at borders and where other than two faces meet.
        std::array<HalfEdge, 3> opposite;

        Vec3f normal() const { return {area_normal[1], area_normal[2], area_normal[3]}; }
    };

    void assign(const Mesh& mesh);

    /// From now on the face is nobody's neighbour and nearest to nothing.
    void remove(uint32_t f);
    bool isRemoved(uint32_t f) const { return !removed_.empty() && removed_[f] != 0; }

    uint32_t faceCount() const { return uint32_t(face_.size()); }
    uint32_t vertexCount() const { return uint32_t(vertex_.size()); }
    const Face& face(uint32_t f) const { return face_[f]; }
    const Vertex& vertex(uint32_t v) const { return vertex_[v]; }
    Vec3f position(uint32_t v) const {
        const auto& p = vertex_[v].lanes;
        return {p[1], p[2], p[3]};
    }
    Vec3f corner(uint32_t f, int k) const { return position(face_[f].vertex[k]); }
    /// Some face at a vertex, kNone if there is none.
    uint32_t faceAt(uint32_t v) const {
        for (uint32_t i = first_out_[v]; i < first_out_[v + 1]; ++i)
            if (!isRemoved(out_[i].face())) return out_[i].face();
        return kNone;
    }

    /// The face in coordinates relative to `origin`, a lattice point: exact.
    LocalTriangle local(uint32_t f, const Vec3f& origin) const {
        return {corner(f, 0) - origin, corner(f, 1) - origin, corner(f, 2) - origin,
                face_[f].normal()};
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
    /// Boxes of four runs of faces or of four groups of such boxes; empty where there are none.
    struct alignas(16) BoxGroup {
        std::array<Lanes4, 3> min, max;
        Lanes4 squaredDistance(const Vec3f& p) const;
    };
    void listHalfEdges();
    uint32_t onlyHalfEdge(uint32_t from, uint32_t to) const;
    void linkNeighbours();
    void computeNormals();
    void buildTree() const;
    void search(size_t level, uint32_t group, const Vec3f& at, const Vec3f& origin, const Vec3f& p,
                std::span<const float> offset, Nearest& best) const;

    std::vector<Vertex> vertex_;
    std::vector<Face> face_;
    /// Half-edges that leave vertex v: [first_out_[v], first_out_[v + 1]) of the two lists.
    static constexpr uint32_t kMatchWidth = 8;
    std::vector<uint32_t> first_out_;
    std::vector<uint32_t> out_target_;  ///< where they end; padded by kMatchWidth
    std::vector<HalfEdge> out_;
    /// Level 0 over runs of kRun faces, four to a group; each level over the groups of the one
    /// before.
    mutable std::vector<std::vector<BoxGroup>> tree_;
    std::vector<uint8_t> removed_;  ///< one a face; empty: none is
    mutable bool tree_valid_ = false;
};

}  // namespace pietra::deviation
