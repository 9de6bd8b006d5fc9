#pragma once
// Triangles that come too near the eye, or whose image is too large for exact arithmetic, are cut
// to a polygon in view space (Sutherland and Hodgman). A cut point depends on the two ends of the
// edge alone, taken in a canonical order, and whoever keeps a vertex computes its image as the fast
// path does: neighbours stay joined, cut or not.

#include <array>
#include <cstdint>

#include "render/raster/projection.h"

namespace pietra {

struct ScreenPoint {
    int32_t x, y;     ///< 1/256 pixel, within twice the guard band
    float inv_depth;  ///< as in ScreenVertex
};

/// Three corners and one more for each of five planes, and some to spare for rounding.
inline constexpr int kMaxClipped = 12;

/// Convex but for rounding, in the triangle's own orientation.
struct ScreenPolygon {
    std::array<ScreenPoint, kMaxClipped> point;
    int count = 0;  ///< 0: nothing is left
};

ScreenPolygon clipTriangle(const Projection& projection, const std::array<Vec3i, 3>& corner);

}  // namespace pietra
