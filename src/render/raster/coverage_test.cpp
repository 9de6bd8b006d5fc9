// Which samples a triangle covers, and how deep: the SIMD kernel against the scalar code bit for
// bit, and both against a brute-force reference.

#include "render/raster/coverage.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cmath>
#include <random>

#include "render/raster/triangle_kernel.h"

namespace pietra {
namespace {

/// Sets every SIMD level in turn, the best one last.
template <class Body>
void forEachTarget(const Body& body) {
    for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
        hwy::SetSupportedTargetsForTest(target);
        hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        body(hwy::TargetName(target));
    }
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
}

constexpr int kWidth = 50, kHeight = 40;

struct Buffer {
    int samples;
    std::vector<VisibilityKey> key;
    explicit Buffer(int sample_count)
        : samples(sample_count), key(size_t(kWidth) * kHeight * sample_count, 0) {}
    VisibilityTile tile(const PixelBox& box = {0, 0, kWidth, kHeight}) {
        return {key.data(), kWidth, samples, box};
    }
};

struct Soup {
    std::vector<ScreenVertex> vertex;
    std::vector<Triangle> triangle;
};

/// Triangles with extents up to `extent` in 1/256 pixel around places in and around the picture;
/// with `grid`, corners at its multiples, so that samples fall on edges and corners.
Soup randomSoup(std::mt19937& random, int count, int extent, int grid) {
    Soup soup;
    std::uniform_int_distribution<int> x(-2000, kWidth * 256 + 2000),
        y(-2000, kHeight * 256 + 2000);
    std::uniform_int_distribution<int> offset(-extent / 2, extent / 2);
    std::uniform_real_distribution<float> depth(0.01f, 1);
    const auto snap = [&](int v) { return int32_t(std::lround(double(v) / grid)) * grid; };
    for (int i = 0; i < count; ++i) {
        const int cx = x(random), cy = y(random);
        for (int k = 0; k < 3; ++k)
            soup.vertex.push_back(
                {snap(cx + offset(random)), snap(cy + offset(random)), depth(random), {}});
        const auto v = uint32_t(3 * i);
        soup.triangle.push_back({v, v + 1, v + 2});
    }
    return soup;
}

ScreenPoint point(const ScreenVertex& v) {
    return {v.x, v.y, v.inv_depth};
}

void drawScalar(const Soup& soup, const VisibilityTile& tile, bool both_sides) {
    for (size_t i = 0; i < soup.triangle.size(); ++i) {
        const Triangle& t = soup.triangle[i];
        drawTriangle(tile,
                     {point(soup.vertex[t[0]]), point(soup.vertex[t[1]]), point(soup.vertex[t[2]])},
                     both_sides, uint32_t(i));
    }
}

void drawKernel(const Soup& soup, const VisibilityTile& tile, bool both_sides) {
    std::vector<uint32_t> clipped;
    drawTriangles(tile,
                  {soup.triangle.data(), soup.triangle.size(), 0, soup.vertex.data(), both_sides},
                  clipped);
    EXPECT_TRUE(clipped.empty());
}

/// A point moved by (eps, eps^2) is strictly inside, which is what the top-left rule says. +1:
/// inside a triangle seen from the front (counter-clockwise where y points up), -1: from the back.
int sideThatCovers(const std::array<ScreenPoint, 3>& c, int64_t x, int64_t y) {
    const auto side = [&](const ScreenPoint& p, const ScreenPoint& q) {
        const __int128 dx = int64_t(q.x) - p.x, dy = int64_t(q.y) - p.y;
        const __int128 value = dx * (y - p.y) - dy * (x - p.x);
        if (value != 0) return value > 0 ? 1 : -1;
        if (dy != 0) return dy < 0 ? 1 : -1;
        return dx > 0 ? 1 : dx < 0 ? -1 : 0;
    };
    const int s = side(c[0], c[1]);
    return s != 0 && side(c[1], c[2]) == s && side(c[2], c[0]) == s ? -s : 0;
}

struct Shape {
    int extent, grid;
};
constexpr Shape kShapes[] = {{100, 1},   {300, 1},     {300, 16},     {600, 64}, {2000, 128},
                             {8000, 32}, {40000, 128}, {40000000, 1}, {300, 256}};

TEST(Coverage, EqualsTheExactReferenceOnEverySample) {
    std::mt19937 random(1);
    for (const int samples : {1, 4})
        for (const Shape shape : kShapes)
            for (const bool both_sides : {false, true}) {
                const Soup soup = randomSoup(random, 60, shape.extent, shape.grid);
                for (size_t i = 0; i < soup.triangle.size(); ++i) {
                    const std::array<ScreenPoint, 3> c{point(soup.vertex[3 * i]),
                                                       point(soup.vertex[3 * i + 1]),
                                                       point(soup.vertex[3 * i + 2])};
                    Buffer buffer(samples);
                    drawTriangle(buffer.tile(), c, both_sides, 0);
                    size_t wrong = 0;
                    for (int y = 0; y < kHeight; ++y)
                        for (int x = 0; x < kWidth; ++x)
                            for (int s = 0; s < samples; ++s) {
                                const SampleOffset at = sampleOffsets(samples)[s];
                                const int side =
                                    sideThatCovers(c, x * 256 + 128 + at.x, y * 256 + 128 + at.y);
                                const bool expected = side > 0 || (side < 0 && both_sides);
                                const size_t key = (size_t(y) * kWidth + x) * samples + s;
                                wrong += (buffer.key[key] != 0) != expected;
                            }
                    ASSERT_EQ(wrong, 0u) << "extent " << shape.extent << ", triangle " << i;
                }
            }
}

TEST(Coverage, KernelEqualsScalarBitForBitOnEveryTarget) {
    forEachTarget([](const char* target) {
        std::mt19937 random(2);
        size_t covered = 0;
        for (const int samples : {1, 4})
            for (const Shape shape : kShapes)
                for (const int count : {1, 15, 300}) {
                    const bool both_sides = count != 15;
                    const Soup soup = randomSoup(random, count, shape.extent, shape.grid);
                    Buffer scalar(samples), kernel(samples);
                    drawScalar(soup, scalar.tile(), both_sides);
                    drawKernel(soup, kernel.tile(), both_sides);
                    ASSERT_EQ(scalar.key, kernel.key) << target << " extent " << shape.extent;
                    covered += size_t(std::count_if(kernel.key.begin(), kernel.key.end(),
                                                    [](VisibilityKey k) { return k != 0; }));
                }
        EXPECT_GT(covered, 10000u) << target;
    });
}

TEST(Coverage, TilesTogetherGiveThePictureAndTouchNothingElse) {
    std::mt19937 random(3);
    for (const int samples : {1, 4})
        for (const Shape shape : kShapes) {
            const Soup soup = randomSoup(random, 200, shape.extent, shape.grid);
            Buffer whole(samples), tiled(samples);
            drawKernel(soup, whole.tile(), true);
            for (const PixelBox& box : {PixelBox{0, 0, 17, 40}, {17, 0, 50, 3}, {17, 3, 30, 40}}) {
                const std::vector<VisibilityKey> before = tiled.key;
                drawKernel(soup, tiled.tile(box), true);
                for (int y = 0; y < kHeight; ++y)
                    for (int x = 0; x < kWidth; ++x)
                        for (int s = 0; s < samples; ++s) {
                            const bool inside =
                                x >= box.x0 && x < box.x1 && y >= box.y0 && y < box.y1;
                            const size_t i = (size_t(y) * kWidth + x) * samples + s;
                            ASSERT_EQ(tiled.key[i], inside ? whole.key[i] : before[i]);
                        }
            }
        }
}

TEST(Coverage, DepthIsInterpolatedWithinTheCorners) {
    std::mt19937 random(4);
    size_t compared = 0;
    for (const Shape shape : kShapes) {
        const Soup soup = randomSoup(random, 100, shape.extent, shape.grid);
        for (const Triangle& t : soup.triangle) {
            const std::array<ScreenPoint, 3> c{point(soup.vertex[t[0]]), point(soup.vertex[t[1]]),
                                               point(soup.vertex[t[2]])};
            Buffer buffer(1);
            drawTriangle(buffer.tile(), c, true, 0);
            const double ux = c[1].x - double(c[0].x), uy = c[1].y - double(c[0].y);
            const double vx = c[2].x - double(c[0].x), vy = c[2].y - double(c[0].y);
            for (int i = 0; i < kWidth * kHeight; ++i) {
                if (buffer.key[i] == 0) continue;
                const double px = i % kWidth * 256 + 128 - c[0].x,
                             py = i / kWidth * 256 + 128 - c[0].y;
                const double b1 = (px * vy - py * vx) / (ux * vy - uy * vx);
                const double b2 = (py * ux - px * uy) / (ux * vy - uy * vx);
                const double expected = c[0].inv_depth +
                                        b1 * (c[1].inv_depth - double(c[0].inv_depth)) +
                                        b2 * (c[2].inv_depth - double(c[0].inv_depth));
                EXPECT_NEAR(std::bit_cast<float>(uint32_t(buffer.key[i] >> 32)), expected, 1e-6);
                ++compared;
            }
        }
    }
    EXPECT_GT(compared, 10000u);
}

TEST(Coverage, NearerWinsAndOfEqualDepthsTheFirst) {
    const Soup soup{{{0, 0, 0.5f, {}},
                     {20000, 0, 0.5f, {}},
                     {0, 20000, 0.5f, {}},
                     {0, 0, 0.6f, {}},
                     {2000, 0, 0.6f, {}},
                     {0, 2000, 0.6f, {}}},
                    {{0, 1, 2}, {0, 1, 2}, {3, 4, 5}, {0, 1, 2}}};
    for (const int samples : {1, 4}) {
        Buffer buffer(samples);
        drawKernel(soup, buffer.tile(), true);
        EXPECT_EQ(triangleNumber(buffer.key[0]), 2u);
        EXPECT_EQ(triangleNumber(buffer.key[20 * samples]), 0u);
        // What is resolved keeps its place against an equal depth.
        for (VisibilityKey& key : buffer.key)
            if (key != 0) key |= kResolved;
        const std::vector<VisibilityKey> before = buffer.key;
        drawKernel(soup, buffer.tile(), true);
        EXPECT_EQ(buffer.key, before);
    }
}

TEST(Coverage, CornersWithoutImageAreLeftToTheClipperUnlessAllAreBehind) {
    forEachTarget([](const char* target) {
        std::mt19937 random(5);
        Soup soup = randomSoup(random, 40, 300, 1);
        for (size_t i = 0; i < 40; ++i)
            for (size_t k = 0; k < i % 4; ++k) {
                soup.vertex[3 * i + k].x = kNoImage;
                soup.vertex[3 * i + k].y = i % 8 < 4 ? kBehind : kBeyond;
            }
        std::vector<uint32_t> expected, clipped;
        for (uint32_t i = 0; i < 40; ++i)
            if (i % 4 != 0 && i % 8 != 3) expected.push_back(i);
        Buffer buffer(1);
        drawTriangles(buffer.tile(), {soup.triangle.data(), 40, 0, soup.vertex.data(), true},
                      clipped);
        EXPECT_EQ(clipped, expected) << target;
    });
}

}  // namespace
}  // namespace pietra
