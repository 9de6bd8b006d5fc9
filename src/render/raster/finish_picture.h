#pragma once
// The last step of a picture: samples become pixels, what is empty becomes background, keys become
// depths, and the visibility buffer is left empty for the next picture.

#include <cstdint>
#include <vector>

#include "render/picture.h"
#include "render/raster/coverage.h"
#include "render/shading.h"

namespace pietra {

/// `sample_colour` holds four colours a pixel where `samples` is 4, and is not read where it is 1:
/// the colours are then in `picture` already. Samples are averaged in linear light; the depth is
/// that of the nearest one. Returns how many pixels are covered.
uint64_t finishPicture(const ShadeSettings& settings, int samples, std::vector<VisibilityKey>& key,
                       const std::vector<Rgba8>& sample_colour, Picture& picture);

}  // namespace pietra
