#include <gtest/gtest.h>

#include <random>

#include "multires/view.h"

namespace pietra {
namespace {

Vec3d unit(std::mt19937& random) {
    std::normal_distribution<double> normal;
    return glm::normalize(Vec3d(normal(random), normal(random), normal(random)));
}


/// Image position of a lattice point.
glm::dvec2 project(const View& view, const Vec3d& p) {
    const Vec3d d = p - view.eye();
    const double depth = -glm::dot(view.back(), d);
    return view.focal_px() * glm::dvec2(glm::dot(view.right(), d), glm::dot(view.up(), d)) / depth;
}

bool insidePicture(const View& view, const glm::dvec2& q) {
    return std::abs(q.x) <= view.size().width * 0.5 && std::abs(q.y) <= view.size().height * 0.5;
}

TEST(View, errorInPixelsBoundsTheMotionOfImagePoints) {
    std::mt19937 random(1);
    std::uniform_real_distribution<double> uniform(0, 1);
    const Camera camera{{0, 0, 0}, {1, 2, 3}, {0, 0, 1}, 70};
    const View view(camera, {800, 600}, Lattice{});
    double worst = 0;
    int tried = 0;
    for (int i = 0; i < 200000; ++i) {
        const Sphere sphere{Vec3f(Vec3d(1, 2, 3) * 20.0 + 30.0 * unit(random)), 3};
        const Vec3d p = Vec3d(sphere.centre) + 2.9 * uniform(random) * unit(random);
        const double error = 0.5 * uniform(random);
        const Vec3d q = p + error * unit(random);
        if (glm::length(q - Vec3d(sphere.centre)) > 3) continue;
        if (!insidePicture(view, project(view, p)) || !insidePicture(view, project(view, q))) continue;
        ++tried;
        const double stated = view.errorInPixels(float(error), sphere);
        const double moved = glm::length(project(view, p) - project(view, q));
        EXPECT_LE(moved, stated * (1 + 1e-6));
        worst = std::max(worst, moved / stated);
    }
    EXPECT_GT(tried, 1000);
    EXPECT_GT(worst, 0.5);  // it is a bound, but no idle one
}

TEST(View, outsideAndFacesAwayAreConservative) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> uniform(0, 1);
    const View view(Camera{{0, 0, 0}, {0, 1, 0}, {0, 0, 1}, 50}, {640, 480}, Lattice{});
    int outside = 0, away = 0;
    for (int i = 0; i < 20000; ++i) {
        const Sphere sphere{Vec3f(unit(random) * 10.0 * uniform(random)), 1};
        const NormalCone cone{Vec3f(unit(random)), float(uniform(random))};
        for (int k = 0; k < 20; ++k) {
            const Vec3d p = Vec3d(sphere.centre) + unit(random) * uniform(random);
            if (view.outside(sphere) && -glm::dot(view.back(), p - view.eye()) > 0) {
                ++outside;
                EXPECT_FALSE(insidePicture(view, project(view, p)));
            }
            const Vec3d n = unit(random);
            if (glm::dot(n, Vec3d(cone.axis)) >= cone.cos_angle && view.facesAway(cone, sphere)) {
                ++away;
                EXPECT_GT(glm::dot(n, p - view.eye()), 0);
            }
        }
    }
    EXPECT_GT(outside, 100);
    EXPECT_GT(away, 100);
}

}  // namespace
}  // namespace pietra
