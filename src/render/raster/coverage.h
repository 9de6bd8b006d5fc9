#pragma once
// One triangle after another into the visibility buffer: which samples it covers, exactly, and how
// deep it is there. This is the scalar form, for triangles of any size; triangle_kernel.h has the
// fast one for the small, which gives the same bits.
//
// Corners are put in positive order first (clockwise as seen, since y points down). A sample on an
// edge belongs to the triangle whose top or left edge it is; edge values are exact integers and the
// rule takes one off the others, so "inside" means no edge value is negative.

#include <array>
#include <bit>
#include <cstdint>

#include "geometry/mesh.h"
#include "render/raster/clip.h"

namespace pietra {

/// A sample of the visibility buffer: the bits of 1 / depth, which order as the number does, above
/// the complement of the triangle's number: of equal depths the lower number, drawn first, is the
/// larger key. 0: nothing.
using VisibilityKey = uint64_t;
/// Lower word of a sample whose colour is already in the picture; beats equal depths to come.
inline constexpr uint32_t kResolved = 0xffffffff;
inline constexpr uint32_t kMaxTriangleNumber = 0xfffffffe;
inline constexpr uint32_t lowerWord(uint32_t triangle_number) {
    return kMaxTriangleNumber - triangle_number;
}
inline constexpr uint32_t triangleNumber(VisibilityKey key) {
    return kMaxTriangleNumber - uint32_t(key);
}

/// Where a thread draws: a rectangle of the picture, within a buffer that holds a larger one or all
/// of it.
struct VisibilityTile {
    VisibilityKey* key;       ///< of the buffer: sample s of pixel (x, y) is [at(x, y)*samples + s]
    int32_t width;            ///< of the buffer, in pixels
    int samples;              ///< 1 or 4
    PixelBox box;             ///< nothing else is touched
    Rgba8* colour = nullptr;  ///< of samples, laid out as the keys
    int32_t origin = 0;       ///< -at(0, 0): of a buffer that does not begin there

    size_t at(int32_t x, int32_t y) const { return size_t(int64_t(y) * width + x - origin); }
};

/// Extent in x and in y, in 1/256 pixel, up to which a triangle counts as small: its edge values
/// fit 32 bits. Depths are computed in float for small triangles and in double for the others, so
/// this is a property of the image, never of the tile.
inline constexpr int32_t kSmallExtent = 1 << 14;

/// Draws a triangle whose corners are counter-clockwise as seen from its front; nothing, if it is
/// seen from behind and not to be drawn from `both_sides`. Points within twice the guard band.
void drawTriangle(const VisibilityTile& tile, std::array<ScreenPoint, 3> corner, bool both_sides,
                  uint32_t number);

}  // namespace pietra
