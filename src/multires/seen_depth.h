#pragma once
// How far one could see in a picture: what lies behind that was hidden in it. From the last picture
// this tells a frame what need not be as fine as what shows (multires/live_model.h); as it is a
// recorded input, so that the frame is a function of it.

#include <span>
#include <vector>

#include "multires/view.h"

namespace pietra {

struct SeenDepth {
    static constexpr int kTilePixels = 8;

    Camera camera;
    PictureSize size;
    /// The largest depth in each tile, row by row from the upper left: along the view axis, in
    /// input units, infinite where a pixel shows nothing.
    std::vector<float> farthest;

    int columns() const { return (size.width + kTilePixels - 1) / kTilePixels; }
    int rows() const { return (size.height + kTilePixels - 1) / kTilePixels; }
};

/// `depth`: as Picture::depth, one a pixel.
SeenDepth seenDepth(const Camera& camera, const PictureSize& size, std::span<const float> depth);

}  // namespace pietra
