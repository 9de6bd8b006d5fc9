#include "audit/picture_compare.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

#include "audit/distance_transform.h"
#include "base/error.h"

namespace pietra {
namespace {

constexpr float kNothing = std::numeric_limits<float>::infinity();
constexpr double kFocal = 300;

Picture empty(int width, int height) {
    Picture picture;
    picture.size = {width, height};
    picture.focal_px = kFocal;
    picture.colour.assign(picture.pixelCount(), Rgba8{10, 10, 10, 255});
    picture.depth.assign(picture.pixelCount(), kNothing);
    return picture;
}

/// Depth along the view axis where the ray through a pixel meets a sphere, or +inf.
float sphereDepth(const Picture& picture, int x, int y, const Vec3d& centre, double radius) {
    const Vec3d ray((x + 0.5 - picture.size.width * 0.5) / kFocal,
                    (y + 0.5 - picture.size.height * 0.5) / kFocal, 1);
    const double a = glm::dot(ray, ray), b = glm::dot(ray, centre);
    const double root = b * b - a * (glm::dot(centre, centre) - radius * radius);
    return root < 0 ? kNothing : float((b - std::sqrt(root)) / a);
}

float planeDepth(const Picture& picture, int x, int y, const Vec3d& normal, double distance) {
    const Vec3d ray((x + 0.5 - picture.size.width * 0.5) / kFocal,
                    (y + 0.5 - picture.size.height * 0.5) / kFocal, 1);
    const double depth = distance / glm::dot(ray, normal);
    return depth > 0 ? float(depth) : kNothing;
}

/// A sphere in front of another and of a slanted plane.
Picture scene(int width, int height, const Vec3d& shift) {
    Picture picture = empty(width, height);
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            const size_t i = picture.index(x, y);
            picture.depth[i] =
                std::min({sphereDepth(picture, x, y, Vec3d(-1, 0, 10) + shift, 1.5),
                          sphereDepth(picture, x, y, Vec3d(0.5, 0.3, 14) + shift, 2)});
            picture.colour[i] = {uint8_t(x), uint8_t(y), 0, 255};
        }
    return picture;
}

TEST(DistanceTransform, EqualsBruteForce) {
    std::mt19937 random(1);
    for (const PictureSize size : {PictureSize{37, 23}, {1, 1}, {1, 19}, {40, 2}})
        for (const int density : {1000, 40, 3}) {
            const int width = size.width, height = size.height;
            std::vector<uint8_t> mask(size_t(width) * height);
            for (uint8_t& m : mask) m = random() % unsigned(density) == 0;
            std::vector<int32_t> expected(mask.size());
            for (int y = 0; y < height; ++y)
                for (int x = 0; x < width; ++x) {
                    int best = std::min({x + 1, y + 1, width - x, height - y});
                    best *= best;
                    for (int v = 0; v < height; ++v)
                        for (int u = 0; u < width; ++u)
                            if (mask[size_t(v) * width + u] != 0)
                                best = std::min(best, (u - x) * (u - x) + (v - y) * (v - y));
                    expected[size_t(y) * width + x] = best;
                }
            EXPECT_EQ(squaredDistances(mask, size), expected);
        }
}

TEST(PictureCompare, APictureEqualsItself) {
    const Picture a = scene(160, 120, {0, 0, 0});
    const PictureDifference d = compare(a, a);
    EXPECT_TRUE(d.has_depth);
    EXPECT_EQ(d.pixels, 160u * 120u);
    EXPECT_GT(d.covered_a, 5000u);
    EXPECT_EQ(d.covered_a, d.covered_b);
    EXPECT_EQ(d.only_a + d.only_b, 0u);
    EXPECT_GT(d.edge_px.count, 300u);
    EXPECT_GT(d.depth_px.count, 2 * d.covered_a * 9 / 10);
    EXPECT_LT(d.depth_px.count, 2 * d.covered_a);
    EXPECT_EQ(d.shade.count, d.covered_a);
    EXPECT_EQ(d.largestPx(), 0);
    EXPECT_EQ(d.shade.max, 0);
}

Picture shifted(const Picture& in, int dx, int dy) {
    Picture out = empty(in.size.width, in.size.height);
    for (int y = 0; y < in.size.height; ++y)
        for (int x = 0; x < in.size.width; ++x) {
            const int u = x - dx, v = y - dy;
            if (u < 0 || v < 0 || u >= in.size.width || v >= in.size.height) continue;
            out.depth[out.index(x, y)] = in.depth[in.index(u, v)];
            out.colour[out.index(x, y)] = in.colour[in.index(u, v)];
        }
    return out;
}

TEST(PictureCompare, AShiftedPictureGivesTheShift) {
    const Picture a = scene(200, 160, {0, 0, 0});
    for (const auto& [dx, dy] : {std::pair{1, 0}, {0, 3}, {-4, 0}, {3, -4}}) {
        const PictureDifference d = compare(a, shifted(a, dx, dy));
        const double shift = std::hypot(dx, dy);
        EXPECT_NEAR(d.coverage_px.max, shift, 0.5);
        EXPECT_LE(d.coverage_px.max, shift);
        EXPECT_EQ(d.only_a, d.only_b);
        EXPECT_GT(d.only_a, 50u);
        EXPECT_LE(d.edge_px.max, shift);
        EXPECT_GT(d.edge_px.max, shift * 0.9);
        EXPECT_EQ(d.shade.max, std::max(std::abs(dx), std::abs(dy)));
        if (shift <= kDepthRadius) {
            EXPECT_LE(d.depth_px.max, shift + 1e-3);
        }
    }
}

TEST(PictureCompare, DepthErrorIsTheDisplacementWhateverTheSlope) {
    for (const double slope : {0.0, 0.5, 2.0, 8.0})
        for (const double move_px : {0.02, 0.3, 1.0}) {
            const Vec3d normal = glm::normalize(Vec3d(slope, 0.3 * slope, 1));
            // The nearest points in view are about 4 units deep: that sets the scale.
            const double distance = 10 * normal.z;
            Picture a = empty(64, 48), b = a;
            double least = 1e9;
            for (int y = 0; y < 48; ++y)
                for (int x = 0; x < 64; ++x) {
                    const size_t i = a.index(x, y);
                    a.depth[i] = planeDepth(a, x, y, normal, distance);
                    b.depth[i] = planeDepth(b, x, y, normal, distance + move_px * 10 / kFocal);
                    least = std::min(least, double(a.depth[i]));
                }
            const PictureDifference d = compare(a, b);
            EXPECT_EQ(d.only_a + d.only_b, 0u);
            // Displaced by move_px at depth 10; by more where the plane is nearer, by less behind.
            EXPECT_NEAR(d.depth_px.mean, move_px, 0.25 * move_px) << slope << " " << move_px;
            EXPECT_LE(d.depth_px.p99, move_px * 10 / least * 1.1) << slope << " " << move_px;
        }
}

TEST(PictureCompare, SubpixelMotionOfASphereIsFoundAsSuch) {
    // 0.4 pixel to the right at depth 10: silhouettes flip single pixels, nothing is farther.
    const PictureDifference d =
        compare(scene(200, 160, {0, 0, 0}), scene(200, 160, {0.4 * 10 / kFocal, 0, 0}));
    EXPECT_GT(d.only_a, 5u);
    EXPECT_EQ(d.coverage_px.max, 1);
    EXPECT_LE(d.edge_px.max, std::sqrt(2.0));
    EXPECT_LE(d.depth_px.p99, 0.45);
    EXPECT_LE(d.depth_px.max, 1);
    EXPECT_GT(d.depth_px.mean, 0.05);
}

TEST(PictureCompare, AMissingPieceIsFarFromEverything) {
    const Picture a = scene(200, 160, {0, 0, 0});
    Picture b = a;
    for (int y = 60; y < 80; ++y)
        for (int x = 60; x < 80; ++x) b.depth[b.index(x, y)] = kNothing;
    const PictureDifference d = compare(a, b);
    EXPECT_EQ(d.only_a, 400u);
    EXPECT_EQ(d.only_b, 0u);
    EXPECT_EQ(d.coverage_px.max, 10);
    EXPECT_EQ(compare(b, a).only_b, 400u);
}

/// A wall at depth 10, but for pixels where `depth` says otherwise.
template <class Depth>
Picture wall(const Depth& depth) {
    Picture picture = empty(120, 100);
    for (int y = 0; y < 100; ++y)
        for (int x = 0; x < 120; ++x) picture.depth[picture.index(x, y)] = depth(x, y);
    return picture;
}

constexpr float kNear = 10, kFar = 14;  // a step of 120 pixels

TEST(PictureCompare, HairlinesAreCountedAndNotCompared) {
    const Picture whole = wall([](int, int) { return kNear; });
    for (const int supersampled : {1, 4})
        for (const int width : {1, 4, 5})
            for (const bool steep : {false, true})
                for (const float behind : {kFar, kNothing}) {
                    const Picture slit = wall([&](int x, int y) {
                        const int from_start = steep ? y - 30 - x / 3 : x - 50;
                        const bool ends = x < 20 || x > 90 || y < 10;
                        // The side that is a little farther makes no edge of its own.
                        return !ends && from_start >= 0 && from_start < width ? behind
                               : from_start < 0                               ? kNear + 0.1f
                                                                              : kNear;
                    });
                    const PictureDifference d = compare(slit, whole, supersampled),
                                            r = compare(whole, slit, supersampled);
                    const bool hairline = width <= supersampled;
                    EXPECT_EQ(d.edge_px.max > 2, !hairline) << supersampled << " " << width;
                    if (hairline)
                        EXPECT_EQ(d.hairline_a, uint64_t(width) * (steep ? 71 : 90));
                    else
                        EXPECT_LT(d.hairline_a, 20u);  // in the corners of its ends
                    EXPECT_EQ(d.hairline_b, 0u);
                    EXPECT_EQ(r.hairline_b, d.hairline_a);
                    EXPECT_EQ(r.edge_px.max, d.edge_px.max);
                }
}

TEST(PictureCompare, NothingElseThatIsThinIsAHairline) {
    const Picture far = wall([](int, int) { return kFar; });
    const auto stripes = [](int x) { return x > 30 && x < 90 && x % 2 == 0; };
    const std::pair<const char*, std::pair<Picture, Picture>> lost[] = {
        {"a thin bar", {wall([](int x, int) { return x == 60 ? kNear : kFar; }), far}},
        {"a bar", {wall([](int x, int) { return x / 4 == 15 ? kNear : kFar; }), far}},
        {"bars beside slits", {wall([&](int x, int) { return stripes(x) ? kNear : kFar; }), far}},
        {"a step", {wall([](int x, int) { return x < 60 ? kNear : kFar; }), far}},
        {"a slit into which another step falls",
         {wall([](int x, int) { return x == 60 ? kFar : kNear; }),
          wall([](int x, int) { return x < 20 ? kNear : kNear + 1; })}},
    };
    for (const auto& [what, pictures] : lost)
        for (const int supersampled : {1, 4}) {
            const PictureDifference d = compare(pictures.first, pictures.second, supersampled);
            EXPECT_EQ(d.hairline_a + d.hairline_b, 0u) << what;
            EXPECT_GT(d.edge_px.max, 2) << what;
        }
}

TEST(PictureCompare, WithoutDepthOnlyShadeIsCompared) {
    Picture a = scene(30, 20, {0, 0, 0});
    Picture b = a;
    b.depth.clear();
    b.colour[7].g = uint8_t(b.colour[7].g + 200);
    const PictureDifference d = compare(a, b);
    EXPECT_FALSE(d.has_depth);
    EXPECT_EQ(d.shade.count, 600u);
    EXPECT_EQ(d.shade.max, 200);
    EXPECT_EQ(d.shade.p99, 0);
    EXPECT_DOUBLE_EQ(d.shade.mean, 200.0 / 600);
}

TEST(PictureCompare, RefusesPicturesOfDifferentViews) {
    const Picture a = empty(30, 20);
    Picture b = empty(30, 20);
    b.focal_px = 400;
    try {
        compare(a, empty(20, 30));
        FAIL();
    } catch (const UsageError& error) {
        EXPECT_STREQ(error.what(), "the pictures differ in size: 30x20 and 20x30");
    }
    try {
        compare(a, b);
        FAIL();
    } catch (const UsageError& error) {
        EXPECT_STREQ(error.what(), "the pictures differ in focal length: 300 and 400 pixels");
    }
}

}  // namespace
}  // namespace pietra
