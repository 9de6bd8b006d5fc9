#pragma once
// Cutting the picture among the threads: rectangles with about equal work, so that each is drawn by
// one thread without locks. Pieces of work on a border are set up by the rectangles on both sides,
// so the cuts are as few as the threads need.

#include <cstdint>
#include <span>
#include <vector>

#include "render/raster/batch.h"

namespace pietra {

struct DrawTile {
    PixelBox box;
    std::vector<uint32_t> chunk;  ///< touching the tile, ascending
};

/// What a picture is cut into: disjoint, and together all of it.
struct Tiling {
    std::vector<DrawTile> tiles;  ///< costly ones first
    std::vector<PixelBox> empty;  ///< that no chunk touches
};

/// At most so many tiles, and more only where they would be too large (2^17 pixels).
Tiling makeTiles(std::span<const DrawChunk> chunks, const PixelBox& screen, size_t tiles);

}  // namespace pietra
