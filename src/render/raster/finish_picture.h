#pragma once
// The last step of a picture: samples become pixels, what is empty becomes background, and keys
// become depths.

#include <cstdint>

#include "render/picture.h"
#include "render/raster/coverage.h"
#include "render/shading.h"

namespace pietra {

/// The pixels of the tile's box, from its keys, which are 0 then, and its colours; these may be the
/// picture's own where a pixel has one sample. Samples are averaged in linear light; the depth is
/// that of the nearest one. Returns how many pixels are covered.
uint64_t finishTile(const ShadeSettings& settings, const VisibilityTile& tile, Picture& picture);
/// Where nothing was drawn.
void finishEmpty(const ShadeSettings& settings, const PixelBox& box, Picture& picture);

/// Show::kDepth, when all else is done: light where it is near, with the range of the picture.
void paintDepth(Picture& picture);

}  // namespace pietra
