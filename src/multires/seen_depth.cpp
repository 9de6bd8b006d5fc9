#include "multires/seen_depth.h"

#include <algorithm>

#include "base/check.h"
#include "base/parallel.h"

namespace pietra {

SeenDepth seenDepth(const Camera& camera, const PictureSize& size, std::span<const float> depth) {
    CHECK_EQ(depth.size(), size_t(size.width) * size_t(size.height));
    constexpr int kTile = SeenDepth::kTilePixels;
    SeenDepth seen{camera, size, {}};
    const int columns = seen.columns();
    seen.farthest.assign(size_t(columns) * size_t(seen.rows()), 0);
    parallelForSlices(size_t(seen.rows()), 4, [&](size_t begin, size_t end) {
        for (size_t row = begin; row < end; ++row) {
            float* tile = &seen.farthest[row * size_t(columns)];
            const int last = std::min(int(row + 1) * kTile, size.height);
            for (int y = int(row) * kTile; y < last; ++y) {
                const float* pixel = &depth[size_t(y) * size_t(size.width)];
                for (int x = 0; x < size.width; ++x)
                    tile[x / kTile] = std::max(tile[x / kTile], pixel[x]);
            }
        }
    });
    return seen;
}

}  // namespace pietra
