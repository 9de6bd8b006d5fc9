#include "render/raster/farthest_depths.h"

#include <algorithm>
#include <bit>
#include <limits>

namespace pietra {
namespace {

constexpr uint32_t kUnknown = std::numeric_limits<uint32_t>::max();  // no depth has these bits

}  // namespace

FarthestDepths::FarthestDepths(const VisibilityTile& tile)
    : tile_(tile),
      blocks_(blocksOf(tile.box)),
      farthest_(size_t(blocks_.x1 - blocks_.x0) * size_t(blocks_.y1 - blocks_.y0), kUnknown) {}

PixelBox FarthestDepths::blocksOf(const PixelBox& box) {
    return {box.x0 / kSide, box.y0 / kSide, (box.x1 + kSide - 1) / kSide,
            (box.y1 + kSide - 1) / kSide};
}

uint32_t FarthestDepths::look(int32_t x, int32_t y) const {
    const PixelBox box =
        PixelBox{x * kSide, y * kSide, (x + 1) * kSide, (y + 1) * kSide}.intersected(tile_.box);
    const auto samples = size_t(tile_.samples);
    VisibilityKey least = std::numeric_limits<VisibilityKey>::max();
    for (int32_t py = box.y0; py < box.y1; ++py) {
        const VisibilityKey* key = tile_.key + tile_.at(box.x0, py) * samples;
        const VisibilityKey* end = key + size_t(box.x1 - box.x0) * samples;
        for (; key < end; ++key) least = std::min(least, *key);
    }
    return uint32_t(least >> 32);
}

bool FarthestDepths::hide(const PixelBox& box, float nearest) {
    const auto bits = std::bit_cast<uint32_t>(nearest);
    const PixelBox asked = blocksOf(box);
    for (int32_t y = asked.y0; y < asked.y1; ++y)
        for (int32_t x = asked.x0; x < asked.x1; ++x) {
            uint32_t& farthest = at(x, y);
            if (farthest == kUnknown) farthest = look(x, y);
            if (farthest <= bits) return false;
        }
    return true;
}

void FarthestDepths::changed(const PixelBox& box) {
    const PixelBox blocks = blocksOf(box);
    for (int32_t y = blocks.y0; y < blocks.y1; ++y)
        std::fill_n(&at(blocks.x0, y), blocks.x1 - blocks.x0, kUnknown);
}

}  // namespace pietra
