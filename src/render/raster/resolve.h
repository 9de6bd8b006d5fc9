#pragma once
// From the visibility buffer to colours, chunk by chunk, so that a patch's data is fetched once:
// finds what is visible of the chunk in a tile, shades it and marks it as resolved.

#include "render/raster/coverage.h"
#include "render/raster/pixel_shader.h"

namespace pietra {

/// Only samples within the tile's box are touched.
void resolveChunk(const VisibilityTile& tile, const DrawChunk& chunk, const PixelShader& shader);

}  // namespace pietra
