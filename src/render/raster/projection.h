#pragma once
// From the lattice to the picture. A vertex's image depends on its lattice point and the view
// alone: the same operations in the same order, in float, in the scalar functions here and in the
// SIMD ones of transform.cpp, so an image is the same bit for bit wherever it is computed.

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>

#include "geometry/lattice.h"
#include "geometry/octahedral.h"
#include "multires/view.h"

namespace pietra {

/// Images are on a grid of 1/256 pixel, pixel centres at odd multiples of 1/2.
inline constexpr int kSubpixelBits = 8;
inline constexpr int32_t kSubpixel = 1 << kSubpixelBits;
inline constexpr int32_t kHalfPixel = kSubpixel / 2;

/// Nearest depth drawn, in lattice units: a sixty-fourth of the distance between lattice points.
inline constexpr float kNearDepth = 1.0f / 64;
/// Images farther out than this go to the clipper (2^20 pixels); products of two differences of
/// what is nearer fit 64 bits with room to spare, also for the clipper's results at twice the
/// distance.
inline constexpr float kGuardFixed = float(1 << 28);
inline constexpr double kClipFixed = double(1 << 29);

/// ScreenVertex::x of a vertex without a usable image; y says why.
inline constexpr int32_t kNoImage = std::numeric_limits<int32_t>::min();
inline constexpr int32_t kBehind = 0;  ///< nearer than kNearDepth or behind the eye
inline constexpr int32_t kBeyond = 1;  ///< in front, outside the guard band

/// Everything rasterising and shading need of a vertex, in 16 bytes.
struct ScreenVertex {
    int32_t x, y;      ///< image, row 0 on top, in 1/256 pixel; or kNoImage and the reason
    float inv_depth;   ///< 1 / depth, depth in input units
    OctNormal normal;  ///< in lattice space
};
static_assert(sizeof(ScreenVertex) == 16);

struct Projection {
    Vec3i origin;  ///< the eye rounded to the lattice, within its cube: subtracted as an integer
    Vec3f right, up, forward;
    Vec3f offset;              ///< of `origin` in view space
    float centre_x, centre_y;  ///< of the picture, in 1/256 pixel
    float scale;               ///< focal length in 1/256 pixel
    float inv_step;            ///< lattice units per input unit

    Projection(const View& view, const Lattice& lattice)
        : right(view.right()), up(view.up()), forward(-view.back()) {
        for (int k = 0; k < 3; ++k)
            origin[k] = int32_t(std::clamp(std::floor(view.eye()[k]), 0.0, double(kLatticeMax)));
        const Vec3d rest = Vec3d(origin) - view.eye();
        offset = Vec3f(glm::dot(view.right(), rest), glm::dot(view.up(), rest),
                       -glm::dot(view.back(), rest));
        centre_x = float(view.size().width) * (kSubpixel / 2.0f);
        centre_y = float(view.size().height) * (kSubpixel / 2.0f);
        scale = float(view.focal_px() * kSubpixel);
        inv_step = float(1 / lattice.step);
    }

    /// Right, up and depth, in lattice units.
    Vec3f viewPosition(const Vec3i& p) const {
        const Vec3f d(p - origin);  // exact
        const auto along = [&](const Vec3f& a, float o) {
            return d.x * a.x + d.y * a.y + d.z * a.z + o;
        };
        return {along(right, offset.x), along(up, offset.y), along(forward, offset.z)};
    }

    /// Image of a view position, without a normal.
    ScreenVertex project(const Vec3f& v) const {
        if (!(v.z >= kNearDepth)) return {kNoImage, kBehind, 0, {}};
        const float inverse = 1 / v.z;
        const float x = centre_x + v.x * scale * inverse;
        const float y = centre_y - v.y * scale * inverse;
        if (!(std::abs(x) <= kGuardFixed && std::abs(y) <= kGuardFixed))
            return {kNoImage, kBeyond, 0, {}};
        return {int32_t(std::lrint(x)), int32_t(std::lrint(y)), inverse * inv_step, {}};
    }
};

/// Half-open rectangle of pixels.
struct PixelBox {
    int32_t x0 = 0, y0 = 0, x1 = 0, y1 = 0;
    bool empty() const { return x0 >= x1 || y0 >= y1; }
    PixelBox intersected(const PixelBox& other) const {
        return {std::max(x0, other.x0), std::max(y0, other.y0), std::min(x1, other.x1),
                std::min(y1, other.y1)};
    }
};

/// Offsets of the samples from the pixel's centre, in 1/256 pixel: the centre itself, or the
/// rotated grid that graphics hardware uses.
struct SampleOffset {
    int32_t x, y;
};
inline constexpr SampleOffset kOneSample[1] = {{0, 0}};
inline constexpr SampleOffset kFourSamples[4] = {{-32, -96}, {96, -32}, {-96, 32}, {32, 96}};
inline const SampleOffset* sampleOffsets(int samples) {
    return samples == 4 ? kFourSamples : kOneSample;
}

}  // namespace pietra
