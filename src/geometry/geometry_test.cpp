#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "geometry/enclosing_ball.h"
#include "geometry/lattice.h"
#include "geometry/morton.h"
#include "geometry/octahedral.h"

namespace pietra {
namespace {

Vec3d unit(std::mt19937& random) {
    std::normal_distribution<double> normal;
    return glm::normalize(Vec3d(normal(random), normal(random), normal(random)));
}

TEST(EnclosingBall, holdsAllPointsAndIsTheSmallest) {
    std::mt19937 random(1);
    for (int i = 0; i < 200; ++i) {
        std::vector<Vec3i> points(1 + size_t(i) % 50);
        for (Vec3i& p : points) p = Vec3i(unit(random) * 1000.0) + 5000;
        const Sphere sphere = enclosingBall(points);
        int on_surface = 0;
        for (const Vec3i& p : points) {
            const double distance = glm::length(Vec3d(p) - Vec3d(sphere.centre));
            EXPECT_LE(distance, sphere.radius);
            on_surface += distance > sphere.radius - 0.01;
        }
        EXPECT_LE(sphere.radius, 1001);
        EXPECT_GE(on_surface, points.size() > 1 ? 2 : 1);
    }
    const std::vector<Vec3i> line = {{0, 0, 0}, {10, 0, 0}, {20, 0, 0}, {20, 0, 0}};
    EXPECT_NEAR(enclosingBall(line).radius, 10, 1e-4);
}

TEST(EnclosingBall, ofBallsEnclosesThem) {
    std::mt19937 random(2);
    std::uniform_real_distribution<float> radius(0, 20);
    for (int i = 0; i < 100; ++i) {
        std::vector<Sphere> balls(1 + size_t(i) % 9);
        for (Sphere& b : balls) b = {Vec3f(unit(random) * 100.0), radius(random)};
        const Sphere sphere = enclosingBall(balls);
        for (const Sphere& b : balls)
            EXPECT_LE(glm::length(Vec3d(b.centre) - Vec3d(sphere.centre)) + b.radius,
                      sphere.radius);
        EXPECT_LE(sphere.radius, 120.2);
    }
    const std::vector<Sphere> two = {{{0, 0, 0}, 1}, {{10, 0, 0}, 2}};
    EXPECT_NEAR(enclosingBall(two).radius, 6.5, 0.03);
    EXPECT_LT(enclosingBall(std::span<const Sphere>()).radius, 0);
}

TEST(EnclosingCone, holdsAllNormals) {
    std::mt19937 random(3);
    for (int i = 0; i < 100; ++i) {
        const Vec3d axis = unit(random);
        std::vector<Vec3f> normals(30);
        for (Vec3f& n : normals) n = Vec3f(glm::normalize(axis + 0.5 * unit(random)));
        const NormalCone cone = enclosingCone(normals);
        for (const Vec3f& n : normals) EXPECT_GE(glm::dot(n, cone.axis), cone.cos_angle);
        EXPECT_GT(cone.cos_angle, 0.85);
    }
}

TEST(Octahedral, keepsDirections) {
    std::mt19937 random(4);
    for (int i = 0; i < 10000; ++i) {
        const Vec3f n(unit(random));
        EXPECT_GT(glm::dot(n, decodeNormal(encodeNormal(n))), 0.99999998f - 1e-6f);
        const OctNormal o = encodeNormal(n);
        EXPECT_EQ(encodeNormal(decodeNormal(o)), o);
    }
}

TEST(Morton, codesAreInOrderAndGiveThePointBack) {
    std::mt19937 random(3);
    for (int trial = 0; trial < 1000; ++trial) {
        const Vec3i p(random() >> 11, random() >> 11, random() >> 11);
        EXPECT_EQ(mortonPoint(mortonCode(p)), p);
    }
    EXPECT_EQ(mortonPoint(mortonCode(Vec3i(kLatticeMax))), Vec3i(kLatticeMax));
    EXPECT_LT(mortonCode({7, 7, 7}), mortonCode({0, 0, 8}));
    EXPECT_LT(mortonCode({8, 0, 0}), mortonCode({0, 8, 0}));
}

TEST(Lattice, keysAreUniqueAndSnappingStaysInside) {
    for (const Vec3i& p :
         {Vec3i(0), Vec3i(kLatticeMax), Vec3i(1, 2, 3), Vec3i(kLatticeMax, 0, 77)}) {
        EXPECT_EQ(latticePoint(latticeKey(p)), p);
        for (int shift = 0; shift <= kMaxLatticeShift; ++shift) {
            const Vec3i q = snapToShift(p, shift);
            EXPECT_LE(q.x, kLatticeMax);
            EXPECT_EQ(q.x % (1 << shift), 0);
            EXPECT_LE(std::abs(q.x - p.x), (1 << shift) / 2);
        }
    }
}

TEST(Lattice, snapsToTheNearestPoint) {
    const Lattice lattice{{100, -100, 0.5}, 0.25, 2};
    EXPECT_EQ(lattice.snap({100, -100, 0.5}), Vec3i(0, 0, 0));
    EXPECT_EQ(lattice.snap({100.49, -99.4, 2.6}), Vec3i(4, 4, 8));
}

}  // namespace
}  // namespace pietra
