#pragma once
// How far away the farthest sample of each block of 8 x 8 pixels of a tile is: what lies behind it
// in all blocks that it touches is hidden. Blocks are looked at when they are asked for, and again
// only after something was drawn there.
//
// Asking is so cheap that a tile's patches are drawn front to back, each if nothing hides it. To
// draw first what was seen in the last picture, as a GPU does that cannot ask in between
// (gl/occlusion.h), was tried, and spared no more triangles.

#include <cstdint>
#include <vector>

#include "render/raster/coverage.h"

namespace pietra {

class FarthestDepths {
public:
    /// Of the tile as it is drawn from now on.
    explicit FarthestDepths(const VisibilityTile& tile);

    /// All samples of `box`, which is within the tile's, have a larger 1 / depth than `nearest`:
    /// nothing that is that far away would change any of them, not even where depths are equal.
    bool hide(const PixelBox& box, float nearest);
    /// Something was drawn within `box`.
    void changed(const PixelBox& box);

private:
    static constexpr int32_t kSide = 8;

    /// Blocks that a box of pixels touches.
    static PixelBox blocksOf(const PixelBox& box);
    uint32_t& at(int32_t x, int32_t y) {
        return farthest_[size_t(y - blocks_.y0) * size_t(blocks_.x1 - blocks_.x0) +
                         size_t(x - blocks_.x0)];
    }
    uint32_t look(int32_t x, int32_t y) const;

    const VisibilityTile& tile_;
    const PixelBox blocks_;
    std::vector<uint32_t> farthest_;  // a block: upper word of its least key, or kUnknown
};

}  // namespace pietra
