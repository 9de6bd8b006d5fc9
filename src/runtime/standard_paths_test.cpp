#include "runtime/standard_paths.h"

#include <gtest/gtest.h>

#include <cmath>

namespace pietra {
namespace {

constexpr StandardPath kAll[] = {StandardPath::kOrbit, StandardPath::kDive, StandardPath::kFlight,
                                 StandardPath::kJumps, StandardPath::kInspection};
constexpr int kFrames = 400;

/// A ball of radius 1.
Surface ball(const Vec3d& centre) {
    Surface surface;
    constexpr int kPoints = 3000;
    for (int i = 0; i < kPoints; ++i) {
        const double z = 1 - (2 * i + 1.0) / kPoints, turn = 2.399963 * i;
        const double r = std::sqrt(1 - z * z);
        const Vec3d n(r * std::cos(turn), r * std::sin(turn), z);
        surface.points.push_back({centre + n, n, 0.001});
    }
    return surface;
}

double hill(double x, double y) {
    return 0.3 * std::sin(x) * std::cos(1.7 * y);
}

/// A square of side 8 with hills, on a slope: its x and z turned by half a right angle.
Vec3d turned(const Vec3d& p) {
    return {(p.x - p.z) * std::sqrt(0.5), p.y, (p.x + p.z) * std::sqrt(0.5)};
}
Vec3d turnedBack(const Vec3d& p) {
    return {(p.x + p.z) * std::sqrt(0.5), p.y, (p.z - p.x) * std::sqrt(0.5)};
}

Surface terrain() {
    Surface surface;
    for (double x = -4; x <= 4; x += 0.1)
        for (double y = -4; y <= 4; y += 0.1)
            surface.points.push_back({turned({x, y, hill(x, y)}), turned({0, 0, 1}), 0.001});
    return surface;
}

TEST(StandardPaths, namesAreThoseOfThePaths) {
    const char* names[] = {"orbit", "dive", "flight", "jumps", "inspection"};
    for (size_t i = 0; i < std::size(kAll); ++i) EXPECT_EQ(parseStandardPath(names[i]), kAll[i]);
    EXPECT_FALSE(parseStandardPath("swim"));
}

TEST(StandardPaths, keepOutOfAClosedBody) {
    const Vec3d centre(5e6, -3, 2);
    const Surface surface = ball(centre);
    for (const StandardPath path : kAll) {
        const CameraPath flown = standardPath(path, surface, UpAxis::kZ, {1280, 1024});
        EXPECT_EQ(flown.seconds, path == StandardPath::kInspection ? 45 : 20);
        double nearest = HUGE_VAL;
        for (int i = 0; i < kFrames; ++i)
            nearest = std::min(nearest, glm::length(flown.frame(i, kFrames).eye - centre) - 1);
        EXPECT_GT(nearest, 0) << int(path);
        EXPECT_LT(nearest, path == StandardPath::kDive ? 0.01 : 10);
    }
}

TEST(StandardPaths, stayOverASurfaceThatFacesOneWay) {
    const Surface surface = terrain();
    for (const StandardPath path : kAll) {
        if (path == StandardPath::kOrbit) continue;
        const CameraPath flown = standardPath(path, surface, UpAxis::kZ, {1280, 1024});
        for (int i = 0; i < kFrames; ++i) {
            const Vec3d eye = turnedBack(flown.frame(i, kFrames).eye);
            if (std::abs(eye.x) > 4 || std::abs(eye.y) > 4) continue;
            ASSERT_GT(eye.z, hill(eye.x, eye.y)) << int(path) << " frame " << i;
        }
    }
}

TEST(StandardPaths, orbitShowsTheWholeInAnyPicture) {
    const Surface surface = ball({1, 2, 3});
    for (const PictureSize& size : {PictureSize{640, 480}, PictureSize{300, 900}}) {
        const CameraPath path = standardPath(StandardPath::kOrbit, surface, UpAxis::kY, size);
        for (int i = 0; i < kFrames; i += 10) {
            const View view(path.frame(i, kFrames), size, Lattice{});
            for (const Surface::Point& p : surface.points) {
                const Vec3d off = p.position - view.eye();
                const double depth = -glm::dot(off, view.back());
                ASSERT_LE(view.focal_px() * std::abs(glm::dot(off, view.right())) / depth,
                          size.width / 2.0);
                ASSERT_LE(view.focal_px() * std::abs(glm::dot(off, view.up())) / depth,
                          size.height / 2.0);
            }
        }
    }
}

}  // namespace
}  // namespace pietra
