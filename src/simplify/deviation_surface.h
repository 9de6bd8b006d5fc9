#pragma once
// A mesh prepared for the deviation bound: neighbours, unit normals, and a search for the nearest
// face. Owned by Deviation; rebuilt for every call without allocating once its arrays are large
// enough.

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "simplify/triangle_distance.h"

namespace pietra::deviation {

inline constexpr uint32_t kNone = ~0u;

class Surface {
public:
    struct Face {
        std::array<uint32_t, 3> vertex;
        /// Across edge k (corners k, k+1): the neighbour's half-edge, 3 * face + edge; kNone at
        /// borders and where other than two faces meet.
        std::array<uint32_t, 3> opposite;
        Vec3f normal;  ///< unit; zero where the face has no area
        float pad;
    };

    /// `mesh` must outlive the use; indices are trusted.
    void assign(const Mesh& mesh);
    void release() { mesh_ = nullptr; }

    uint32_t faceCount() const { return uint32_t(face_.size()); }
    uint32_t vertexCount() const { return uint32_t(mesh_->position.size()); }
    const Face& face(uint32_t f) const { return face_[f]; }
    const Vec3i& position(uint32_t v) const { return mesh_->position[v]; }
    const Vec3i& corner(uint32_t f, int k) const { return position(face_[f].vertex[k]); }
    /// Some face at a vertex, kNone if there is none.
    uint32_t faceAt(uint32_t v) const { return face_at_[v]; }

    /// The face in coordinates relative to `origin`; exact.
    LocalTriangle local(uint32_t f, const Vec3i& origin) const {
        return {Vec3f(corner(f, 0) - origin), Vec3f(corner(f, 1) - origin),
                Vec3f(corner(f, 2) - origin), face_[f].normal};
    }

    struct Nearest {
        uint32_t face = kNone;
        float value = 0;  ///< distance + offset of the face
    };
    /// The face with the smallest distance to `origin + p`, plus `offset[face]` where `offset` is
    /// not empty (offsets are not negative); exact but for rounding. Only values below
    /// `start.value` count; without any, `start` returns.
    Nearest nearest(const Vec3i& origin, const Vec3f& p, std::span<const float> offset,
                    Nearest start) const;

private:
    struct Block {
        Vec3f min, max;
    };
    void linkNeighbours();
    void computeNormals();
    void buildBlocks() const;

    const Mesh* mesh_ = nullptr;
    std::vector<Face> face_;
    std::vector<uint32_t> face_at_;
    std::vector<uint32_t> first_at_vertex_;  ///< scratch: list of half-edges by their lower vertex
    std::vector<uint32_t> next_half_edge_;
    mutable std::vector<Block> block_;  ///< boxes of runs of faces, made when first asked for
    mutable bool blocks_valid_ = false;
};

}  // namespace pietra::deviation
