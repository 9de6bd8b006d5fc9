#include "methods/pmesh/occlusion.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>

#include "methods/pmesh/criterion.h"

namespace pietra::pmesh {
namespace {

constexpr int32_t kNever = std::numeric_limits<int32_t>::max();

int64_t floorDivided(int64_t a, int64_t b) {
    return a / b - (a % b < 0);
}

}  // namespace

Occlusion::Occlusion(const SeenDepth& seen, const Lattice& lattice) {
    const View view(seen.camera, seen.size, lattice);
    const double step = double(1 << lattice.shift);
    const Vec3d eye = view.eye() / step;
    if (glm::any(glm::greaterThan(glm::abs(eye), Vec3d(Criterion::kFarthestEye)))) return;
    eye_ = Vec3i(glm::round(eye));
    const auto axis = [](const Vec3d& a) { return Vec3i(a * double((1 << kAxisBits) - 2)); };
    right_ = axis(view.right());
    down_ = axis(-view.up());
    forward_ = axis(-view.back());
    constexpr double kTile = double(1 << kTileBits) / SeenDepth::kTilePixels;
    tiles_a_slope_ = std::llround(view.focal_px() * kTile);
    middle_x_ = std::llround(0.5 * seen.size.width * kTile);
    middle_y_ = std::llround(0.5 * seen.size.height * kTile);

    Level first{seen.columns(), seen.rows(), {}};
    for (const float depth : seen.farthest) {
        const double steps = double(depth) / (lattice.step * step) + kMarginSteps;
        first.farthest.push_back(steps < 0x1p30 ? int32_t(std::ceil(steps)) : kNever);
    }
    level_.push_back(std::move(first));
    while (level_.back().columns > 1 || level_.back().rows > 1) {
        const Level& fine = level_.back();
        Level coarse{(fine.columns + 1) / 2, (fine.rows + 1) / 2, {}};
        coarse.farthest.assign(size_t(coarse.columns * coarse.rows), 0);
        for (int64_t y = 0; y < fine.rows; ++y)
            for (int64_t x = 0; x < fine.columns; ++x) {
                int32_t& most = coarse.farthest[size_t(y / 2 * coarse.columns + x / 2)];
                most = std::max(most, fine.farthest[size_t(y * fine.columns + x)]);
            }
        level_.push_back(std::move(coarse));
    }
}

/// `near`, `far`: depths, above 0. The slopes of a box are extreme at its edges.
Occlusion::Range Occlusion::tiles(const Vec3i& d, const Vec3i& axis, int64_t radius, int64_t near,
                                  int64_t far, int64_t middle) const {
    const int64_t x = int64_t(axis.x) * d.x + int64_t(axis.y) * d.y + int64_t(axis.z) * d.z;
    const int64_t low = (x >> kAxisBits) - radius, high = -(-x >> kAxisBits) + radius;
    const int64_t left = floorDivided(tiles_a_slope_ * low, low < 0 ? near : far);
    const int64_t right = -floorDivided(-tiles_a_slope_ * high, high < 0 ? far : near);
    return {(middle + left - kMarginTiles) >> kTileBits,
            (middle + right + kMarginTiles) >> kTileBits};
}

bool Occlusion::hides(const Vec3i& centre, int64_t radius) const {
    if (level_.empty()) return false;
    const Vec3i d = centre - eye_;
    const int64_t z =
        int64_t(forward_.x) * d.x + int64_t(forward_.y) * d.y + int64_t(forward_.z) * d.z;
    const int64_t near = (z >> kAxisBits) - radius, far = -(-z >> kAxisBits) + radius;
    if (near < 1) return false;
    const Range x = tiles(d, right_, radius, near, far, middle_x_);
    const Range y = tiles(d, down_, radius, near, far, middle_y_);
    if (x.first < 0 || y.first < 0 || x.last >= level_[0].columns || y.last >= level_[0].rows)
        return false;
    // Of this level it meets no more than two tiles a side.
    const auto at = size_t(std::bit_width(uint64_t(std::max(x.last - x.first, y.last - y.first))));
    if (at >= level_.size()) return false;
    const Level& level = level_[at];
    for (int64_t row = y.first >> at; row <= y.last >> at; ++row)
        for (int64_t column = x.first >> at; column <= x.last >> at; ++column)
            if (near <= level.farthest[size_t(row * level.columns + column)]) return false;
    return true;
}

}  // namespace pietra::pmesh
