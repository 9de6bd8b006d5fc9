#include "viewer/camera_control.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace pietra {
namespace {

constexpr PictureSize kSize{800, 600};

CameraControl control() {
    Box3d box;
    box.add(Vec3d(-1, -2, -3));
    box.add(Vec3d(4, 2, 1));
    return {box, UpAxis::kZ, standardCamera(StandardView::kFront, UpAxis::kZ, box, kSize)};
}

/// Where a point shows, in pixels.
Vec2d project(const Camera& camera, const Vec3d& p) {
    const View view(camera, kSize, Lattice{});
    const Vec3d d = p - view.eye();
    const double depth = -glm::dot(view.back(), d);
    return {400 + view.focal_px() * glm::dot(view.right(), d) / depth,
            300 - view.focal_px() * glm::dot(view.up(), d) / depth};
}

TEST(CameraControl, turningKeepsTheDistanceAndTheTurntableUpright) {
    CameraControl c = control();
    const double distance = c.pivotDepth();
    std::mt19937 random(1);
    for (int i = 0; i < 1000; ++i) {
        c.rotate(double(random() % 200) - 100, double(random() % 200) - 100, kSize);
        ASSERT_NEAR(c.pivotDepth(), distance, 1e-9 * distance);
        const View view(c.camera(), kSize, Lattice{});
        ASSERT_NEAR(view.right().z, 0, 1e-9);
        ASSERT_GT(view.up().z, 0);
    }
}

TEST(CameraControl, trackballGoesOverThePoles) {
    CameraControl c = control();
    c.setStyle(CameraControl::Style::kTrackball);
    const Vec3d before = c.camera().eye;
    for (int i = 0; i < 12; ++i) c.rotate(0, 100, kSize);  // two heights: a whole turn
    EXPECT_LT(glm::length(c.camera().eye - before), 1e-9);
}

TEST(CameraControl, zoomKeepsThePointUnderTheCursor) {
    CameraControl c = control();
    const Vec3d point = c.pointUnder(200, 450, 7, kSize);
    EXPECT_LT(glm::length(project(c.camera(), point) - Vec2d(200, 450)), 1e-9);
    for (int i = 0; i < 500; ++i) {
        c.zoom(0.9, point);
        ASSERT_LT(glm::length(project(c.camera(), point) - Vec2d(200, 450)), 1e-5);
    }
    EXPECT_GT(glm::length(c.camera().eye - point), 0);
}

TEST(CameraControl, panMovesThePivotWithTheCursor) {
    CameraControl c = control();
    const Vec3d pivot = c.pivot();
    c.pan(30, -20, kSize);
    EXPECT_LT(glm::length(project(c.camera(), pivot) - Vec2d(430, 280)), 1e-6);
}

TEST(CameraControl, frameShowsTheWholeBox) {
    CameraControl c = control();
    c.rotate(77, 33, kSize);
    c.zoom(0.01, c.pivot());
    c.frame(kSize);
    for (int i = 0; i < 8; ++i) {
        const Vec3d corner(i & 1 ? 4 : -1, i & 2 ? 2 : -2, i & 4 ? 1 : -3);
        const Vec2d p = project(c.camera(), corner);
        EXPECT_GE(p.x, 0);
        EXPECT_LE(p.x, 800);
        EXPECT_GE(p.y, 0);
        EXPECT_LE(p.y, 600);
    }
}

TEST(CameraControl, lookingAroundKeepsTheEye) {
    CameraControl c = control();
    const Vec3d eye = c.camera().eye;
    c.look(100, 50, kSize);
    EXPECT_EQ(c.camera().eye, eye);
    c.fly(0, 0, 1);
    EXPECT_NEAR(glm::length(c.camera().eye - eye), c.speed(), 1e-9);
}

}  // namespace
}  // namespace pietra
