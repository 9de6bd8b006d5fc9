#include "runtime/camera_path.h"

#include <gtest/gtest.h>

namespace pietra {
namespace {

CameraPath twoKeys() {
    return {
        10,
        {{2, {{0, 0, 0}, {1, 0, 0}, {0, 0, 1}, 40}}, {6, {{8, 0, 0}, {9, 4, 0}, {0, 1, 0}, 60}}}};
}

TEST(CameraPath, isLinearBetweenKeysAndStandsStillOutside) {
    const CameraPath path = twoKeys();
    EXPECT_EQ(path.at(-1).eye, Vec3d(0, 0, 0));
    EXPECT_EQ(path.at(2).eye, Vec3d(0, 0, 0));
    EXPECT_EQ(path.at(3).eye, Vec3d(2, 0, 0));
    EXPECT_EQ(path.at(4).target, Vec3d(5, 2, 0));
    EXPECT_EQ(path.at(4).up, Vec3d(0, 0.5, 0.5));
    EXPECT_EQ(path.at(4).fovy_deg, 50);
    EXPECT_EQ(path.at(6).eye, Vec3d(8, 0, 0));
    EXPECT_EQ(path.at(99).eye, Vec3d(8, 0, 0));
}

TEST(CameraPath, framesCoverTheWholeFlight) {
    const CameraPath path = twoKeys();
    EXPECT_EQ(path.frame(0, 1).eye, path.at(0).eye);
    EXPECT_EQ(path.frame(0, 11).eye, path.at(0).eye);
    EXPECT_EQ(path.frame(5, 11).eye, path.at(5).eye);
    EXPECT_EQ(path.frame(10, 11).eye, path.at(10).eye);
}

}  // namespace
}  // namespace pietra
