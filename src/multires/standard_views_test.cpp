#include "multires/standard_views.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pietra {
namespace {

constexpr StandardView kAll[] = {StandardView::kFront, StandardView::kBack, StandardView::kLeft,
                                 StandardView::kRight, StandardView::kTop,  StandardView::kBottom,
                                 StandardView::kIso};

/// The farthest that a corner of the box gets from the picture's centre, in half sides of the
/// picture; infinite if a corner is behind the eye.
double extentInPicture(const Camera& camera, const Box3d& box, const PictureSize& size) {
    const View view(camera, size, Lattice{});
    double extent = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d p(corner & 1 ? box.max.x : box.min.x, corner & 2 ? box.max.y : box.min.y,
                      corner & 4 ? box.max.z : box.min.z);
        const Vec3d d = p - view.eye();
        const double depth = -glm::dot(view.back(), d);
        if (!(depth > 0)) return std::numeric_limits<double>::infinity();
        const double x = view.focal_px() * glm::dot(view.right(), d) / depth;
        const double y = view.focal_px() * glm::dot(view.up(), d) / depth;
        extent = std::max({extent, std::abs(x) * 2 / size.width, std::abs(y) * 2 / size.height});
    }
    return extent;
}

TEST(StandardViews, theWholeBoxIsInThePictureAndFillsIt) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int i = 0; i < 2000; ++i) {
        Box3d box;
        const Vec3d corner = 1e6 * Vec3d(uniform(random), uniform(random), uniform(random));
        box.add(corner);
        box.add(corner + 0.1 + Vec3d(uniform(random), uniform(random), uniform(random)));
        const PictureSize size{100 + int(1000 * uniform(random)),
                               100 + int(1000 * uniform(random))};
        const double fovy_deg = 10 + 80 * uniform(random);
        for (const StandardView view : kAll) {
            for (const UpAxis up : {UpAxis::kY, UpAxis::kZ}) {
                const double extent =
                    extentInPicture(standardCamera(view, up, box, size, fovy_deg), box, size);
                EXPECT_LE(extent, 0.95 + 1e-6);
                EXPECT_GE(extent, 0.95 - 1e-6);
            }
        }
    }
}

TEST(StandardViews, flatBoxesAndPointsAreSeen) {
    for (const Vec3d& half : {Vec3d(0, 0, 0), Vec3d(1, 0, 0), Vec3d(0, 1, 0), Vec3d(0, 0, 1),
                              Vec3d(1, 1, 0), Vec3d(0, 1, 1)}) {
        Box3d box;
        box.add(Vec3d(7, 8, 9) - half);
        box.add(Vec3d(7, 8, 9) + half);
        for (const StandardView view : kAll) {
            const Camera camera = standardCamera(view, UpAxis::kZ, box, {1280, 1024});
            EXPECT_LE(extentInPicture(camera, box, {1280, 1024}), 0.95 + 1e-6);
        }
    }
}

TEST(StandardViews, directionsAreAsDocumented) {
    Box3d box;
    box.add(Vec3d(-1));
    box.add(Vec3d(1));
    const auto forward = [&](StandardView view, UpAxis up) {
        const Camera camera = standardCamera(view, up, box, {100, 100});
        return glm::normalize(camera.target - camera.eye);
    };
    const auto up = [&](StandardView view, UpAxis axis) {
        return standardCamera(view, axis, box, {100, 100}).up;
    };
    EXPECT_EQ(forward(StandardView::kFront, UpAxis::kZ), Vec3d(0, 1, 0));
    EXPECT_EQ(up(StandardView::kFront, UpAxis::kZ), Vec3d(0, 0, 1));
    EXPECT_EQ(forward(StandardView::kLeft, UpAxis::kZ), Vec3d(1, 0, 0));
    EXPECT_EQ(forward(StandardView::kTop, UpAxis::kZ), Vec3d(0, 0, -1));
    EXPECT_EQ(up(StandardView::kTop, UpAxis::kZ), Vec3d(0, 1, 0));
    EXPECT_EQ(forward(StandardView::kFront, UpAxis::kY), Vec3d(0, 0, -1));
    EXPECT_EQ(up(StandardView::kFront, UpAxis::kY), Vec3d(0, 1, 0));
    EXPECT_EQ(forward(StandardView::kTop, UpAxis::kY), Vec3d(0, -1, 0));
    EXPECT_GT(glm::dot(forward(StandardView::kIso, UpAxis::kZ), Vec3d(-1, 1, -1)), 1.7);
}

TEST(StandardViews, namesAreParsed) {
    EXPECT_EQ(parseStandardView("front"), StandardView::kFront);
    EXPECT_EQ(parseStandardView("iso"), StandardView::kIso);
    EXPECT_EQ(parseStandardView("Front"), std::nullopt);
    EXPECT_EQ(parseStandardView(""), std::nullopt);
}

TEST(StandardViews, movedCloserKeepsTheBallsInThePicture) {
    const Box3d box{{-1, -1, -1}, {1, 1, 1}};
    const PictureSize size{640, 480};
    const Camera far = standardCamera(StandardView::kIso, UpAxis::kZ, box, size);
    const Sphere ball{{0, 0, 0}, 1};
    const Camera near = movedCloser(far, std::span(&ball, 1), size);
    EXPECT_LT(glm::length(near.eye), 0.7 * glm::length(far.eye));
    // The ball's outline stays inside, and would not with a tenth less.
    const double sine = 1 / glm::length(near.eye);
    const double tan_y = std::tan(near.fovy_deg * 3.14159265 / 360);
    EXPECT_LT(sine / std::sqrt(1 - sine * sine), tan_y);
    EXPECT_GT(sine * 1.1 / std::sqrt(1 - sine * sine * 1.21), tan_y);
    EXPECT_EQ(movedCloser(near, std::span(&ball, 1), size).eye, near.eye);
    const Sphere large{{0, 0, 0}, 10};  // never further away
    EXPECT_EQ(movedCloser(far, std::span(&large, 1), size).eye, far.eye);
}

}  // namespace
}  // namespace pietra
