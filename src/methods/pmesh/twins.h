#pragma once
// Half-edges of indexed triangles. Corner 4 f + k is corner k of face f, and also the half-edge
// from there to the next corner of f.

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace pietra::pmesh {

inline constexpr uint32_t kNoCorner = ~0u;

/// Where a corner's value lies in an array of three a face.
constexpr uint32_t slotOf(uint32_t corner) {
    return corner - (corner >> 2);
}
constexpr uint32_t nextCorner(uint32_t corner) {
    return (corner & 3) == 2 ? corner - 2 : corner + 1;
}
constexpr uint32_t previousCorner(uint32_t corner) {
    return (corner & 3) == 0 ? corner + 2 : corner - 1;
}

struct HalfEdges {
    /// Three a face: the half-edge the other way, or kNoCorner. Only where two triangles share an
    /// edge, in opposite directions, and no other does.
    std::vector<uint32_t> twin;
    /// One a vertex: a corner there, where the fan is open the first; kNoCorner without triangles.
    std::vector<uint32_t> corner_of;
    /// One a vertex: 1 if its triangles are not one fan of such edges and of edges used once.
    std::vector<uint8_t> irregular;
    /// One a half-edge, in slots: how many triangles use the edge, at most 255.
    std::vector<uint8_t> uses;
};

/// n log n. Indices must be below `vertices`.
HalfEdges findHalfEdges(std::span<const Triangle> triangles, size_t vertices);

}  // namespace pietra::pmesh
