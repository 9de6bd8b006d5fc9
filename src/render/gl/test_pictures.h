#pragma once
// For tests: how far the pictures of two renderers may differ, and that they do not differ further.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "render/picture.h"

namespace pietra {

inline bool covered(const Picture& picture, int x, int y) {
    return std::isfinite(picture.depth[picture.index(x, y)]);
}

/// The pixel or one of the eight around it is another's in coverage.
inline bool atSilhouette(const Picture& picture, int x, int y) {
    for (int v = std::max(y - 1, 0); v <= std::min(y + 1, picture.size.height - 1); ++v)
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, picture.size.width - 1); ++u)
            if (covered(picture, u, v) != covered(picture, x, y)) return true;
    return false;
}

struct Difference {
    size_t coverage = 0;         ///< pixels in one and not in the other
    size_t off_silhouettes = 0;  ///< those not within a pixel of one
    size_t shade = 0;            ///< pixels that differ by more than 2 of 255
    size_t depth = 0;            ///< pixels whose depths differ by more than 1e-4
    size_t pixels = 0;
};

inline Difference compare(const Picture& cpu, const Picture& gpu, float depth_tolerance) {
    Difference d;
    d.pixels = cpu.pixelCount();
    for (int y = 0; y < cpu.size.height; ++y)
        for (int x = 0; x < cpu.size.width; ++x) {
            const size_t i = cpu.index(x, y);
            if (covered(cpu, x, y) != covered(gpu, x, y)) {
                ++d.coverage;
                d.off_silhouettes += !atSilhouette(cpu, x, y);
                continue;
            }
            const Rgba8 &a = cpu.colour[i], &b = gpu.colour[i];
            d.shade += std::abs(a.r - b.r) > 2 || std::abs(a.g - b.g) > 2 ||
                       std::abs(a.b - b.b) > 2 || a.a != b.a;
            if (covered(cpu, x, y))
                d.depth += std::abs(cpu.depth[i] - gpu.depth[i]) > depth_tolerance * cpu.depth[i];
        }
    return d;
}

inline void expectAlike(const Picture& cpu, const Picture& gpu, const std::string& what,
                        float depth_tolerance = 5e-4f) {
    ASSERT_EQ(gpu.colour.size(), cpu.colour.size());
    EXPECT_EQ(gpu.focal_px, cpu.focal_px);
    const Difference d = compare(cpu, gpu, depth_tolerance);
    EXPECT_LE(double(d.coverage), 1e-4 * double(d.pixels)) << what;
    EXPECT_EQ(d.off_silhouettes, 0u) << what;
    EXPECT_LE(double(d.shade), 5e-3 * double(d.pixels)) << what;
    EXPECT_LE(double(d.depth), 1e-3 * double(d.pixels)) << what;
}

inline void expectSame(const Picture& a, const Picture& b, const std::string& what) {
    EXPECT_EQ(a.depth, b.depth) << what;
    EXPECT_EQ(a.colour, b.colour) << what;
}

}  // namespace pietra
