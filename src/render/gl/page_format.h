#pragma once
// A page's patches as they lie in the arena: the vertices of all patches, side by side, then the
// indices patch by patch.
//
// A vertex: 8 bytes of position, an offset from the patch's corner with 21 bits an axis as in
// latticeKey(), which holds any extent there is; 4 of the octahedral normal; 4 of colour, if the
// page has colours; 4 for each scalar. Indices have 16 bits where the patch has few vertices.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace pietra {

struct VertexLayout {
    bool colours = false;
    uint32_t scalars = 0;
    static constexpr uint32_t kColourOffset = 12;
    uint32_t scalarOffset() const { return kColourOffset + (colours ? 4 : 0); }
    uint32_t stride() const { return scalarOffset() + 4 * scalars; }
    bool operator==(const VertexLayout&) const = default;
};

/// A patch within its page.
struct PatchRange {
    Vec3i corner{0, 0, 0}, extent{0, 0, 0};  ///< of its box
    uint32_t first_vertex = 0, vertices = 0;
    uint32_t index_offset = 0;  ///< bytes from the first vertex of the page, a multiple of 4
    uint32_t indices = 0;
    bool wide = false;  ///< indices have 32 bits
};

struct PageShape {
    VertexLayout layout;
    std::vector<PatchRange> patches;
    size_t bytes = 0;
};

/// Meshes with vertices must have the same attributes, a normal for each vertex, and extents below
/// 2^21.
PageShape shapeOf(std::span<const Mesh> patches);

/// `count` vertices from `first` on, layout.stride() bytes each, and as many indices.
void packVertices(const Mesh& mesh, const VertexLayout& layout, const Vec3i& corner, size_t first,
                  size_t count, std::byte* out);
void packIndices(const Mesh& mesh, bool wide, size_t first, size_t count, std::byte* out);

}  // namespace pietra
