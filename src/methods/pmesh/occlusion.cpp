#include "methods/pmesh/occlusion.h"

#include <algorithm>
#include <bit>
#include <cmath>

#include "multires/view.h"

namespace pietra::pmesh {

Occlusion::Occlusion(const SeenDepth& seen, const Lattice& lattice, const SplitGrid& grid) {
    const View view(seen.camera, seen.size, lattice);
    const double unit = grid.unit(lattice);
    eye_ = view.eye() / unit - Vec3d(grid.origin) / double(uint64_t(1) << grid.shift);
    right_ = view.right();
    down_ = -view.up();
    forward_ = -view.back();
    tiles_a_slope_ = view.focal_px() / SeenDepth::kTilePixels;
    middle_x_ = 0.5 * seen.size.width / SeenDepth::kTilePixels;
    middle_y_ = 0.5 * seen.size.height / SeenDepth::kTilePixels;

    Level first{seen.columns(), seen.rows(), {}};
    const double margin = kMarginSteps / double(uint64_t(1) << grid.shift);
    for (const float depth : seen.farthest)
        first.farthest.push_back(float(double(depth) / (lattice.step * unit) + margin));
    level_.push_back(std::move(first));
    while (level_.back().columns > 1 || level_.back().rows > 1) {
        const Level& fine = level_.back();
        Level coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
        coarse.farthest.assign(size_t(coarse.columns * coarse.rows), 0);
        for (int64_t y = 0; y < fine.rows; ++y)
            for (int64_t x = 0; x < fine.columns; ++x) {
                float& most = coarse.farthest[size_t(y / 2 * coarse.columns + x / 2)];
                most = std::max(most, fine.farthest[size_t(y * fine.columns + x)]);
            }
        level_.push_back(std::move(coarse));
    }
}

Occlusion::Range Occlusion::along(const NestedCriterion& c, const Vec3d& axis) const {
    Range range{0, 0};
    for (int k = 0; k < 3; ++k) {
        const double min = (double(c.min[size_t(k)]) - eye_[k]) * axis[k];
        const double max = (double(c.max[size_t(k)]) - eye_[k]) * axis[k];
        range.low += std::min(min, max);
        range.high += std::max(min, max);
    }
    return range;
}

bool Occlusion::hides(const NestedCriterion& c) const {
    const Range z = along(c, forward_);
    const double near = z.low - double(NestedCriterion::errorOf(c.error)), far = z.high;
    if (!(near > 0)) return false;
    // The slopes of a box are extreme at its edges.
    const auto tiles = [&](const Range& x, double middle) {
        const double left = tiles_a_slope_ * (x.low / (x.low < 0 ? near : far));
        const double right = tiles_a_slope_ * (x.high / (x.high < 0 ? far : near));
        return Range{std::floor(middle + left - kMarginTiles),
                     std::floor(middle + right + kMarginTiles)};
    };
    const Range x = tiles(along(c, right_), middle_x_), y = tiles(along(c, down_), middle_y_);
    if (!(x.low >= 0 && y.low >= 0 && x.high < double(level_[0].columns) &&
          y.high < double(level_[0].rows)))
        return false;
    // Of this level it meets no more than two tiles a side.
    const auto at = size_t(std::bit_width(uint64_t(std::max(x.high - x.low, y.high - y.low))));
    if (at >= level_.size()) return false;
    const Level& level = level_[at];
    for (auto row = int64_t(y.low) >> at; row <= int64_t(y.high) >> at; ++row)
        for (auto column = int64_t(x.low) >> at; column <= int64_t(x.high) >> at; ++column)
            if (near <= double(level.farthest[size_t(row * level.columns + column)])) return false;
    return true;
}

}  // namespace pietra::pmesh
