#pragma once
// Images of a patch's vertices, several at a time: bit for bit what Projection computes one by one.

#include <cstddef>
#include <span>

#include "render/raster/projection.h"

namespace pietra {

/// What transformVertices() found.
struct ImageBounds {
    bool whole = true;                   ///< every vertex has an image
    bool behind = true;                  ///< no vertex is in front of the eye
    int32_t min_x, min_y, max_x, max_y;  ///< of the images, in 1/256 pixel; min > max without any
    float nearest;                       ///< largest ScreenVertex::inv_depth of them, or 0
};

/// `normal` and `out` are as long as `position`.
ImageBounds transformVertices(const Projection& projection, std::span<const Vec3i> position,
                              std::span<const OctNormal> normal, ScreenVertex* out);

}  // namespace pietra
