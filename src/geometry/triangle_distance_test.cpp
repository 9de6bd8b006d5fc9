#include "geometry/triangle_distance.h"

#include <gtest/gtest.h>

#include <random>

namespace pietra {
namespace {

/// The same distance by other means: barycentric coordinates from the normal equations, else the
/// nearest of three segments, in long double.
double slowDistance(const Vec3d& p, const TriangleCorners& t) {
    using V = glm::vec<3, long double>;
    const V q(p), a(t[0]), u = V(t[1]) - a, v = V(t[2]) - a, w = q - a;
    const long double uu = glm::dot(u, u), uv = glm::dot(u, v), vv = glm::dot(v, v);
    const long double det = uu * vv - uv * uv;
    if (det > 0) {
        const long double s = (glm::dot(w, u) * vv - glm::dot(w, v) * uv) / det;
        const long double r = (glm::dot(w, v) * uu - glm::dot(w, u) * uv) / det;
        if (s >= 0 && r >= 0 && s + r <= 1) return double(glm::length(w - s * u - r * v));
    }
    long double best = 1e30L;
    for (int k = 0; k < 3; ++k) {
        const V from(t[k]), edge = V(t[(k + 1) % 3]) - from;
        const long double length_sq = glm::dot(edge, edge);
        const long double f =
            length_sq > 0 ? std::clamp(glm::dot(q - from, edge) / length_sq, 0.0L, 1.0L) : 0.0L;
        best = std::min(best, glm::length(q - from - f * edge));
    }
    return double(best);
}

TEST(TriangleDistance, agreesWithANotherWay) {
    std::mt19937 random(1);
    const auto integer = [&](int range) { return double(int(random() % unsigned(range))); };
    for (int trial = 0; trial < 30000; ++trial) {
        const int size = 1 << (trial % 21);
        TriangleCorners t;
        for (Vec3d& corner : t) corner = Vec3d(integer(size), integer(size), integer(size));
        if (trial % 7 == 0) t[2] = t[1];                        // a segment
        if (trial % 7 == 1) t[2] = t[0] + 2.0 * (t[1] - t[0]);  // collinear
        if (trial % 7 == 2) t[2] = t[1] + Vec3d(1, 0, 0);       // a sliver
        if (trial % 49 == 3) t[1] = t[2] = t[0];                // a point
        const Vec3d p(integer(size) + 0.25, integer(2 * size), integer(size));
        EXPECT_NEAR(TriangleDistance(t).distance(p), slowDistance(p, t), 1e-8);
    }
}

TEST(TriangleDistance, staysGoodOnSliversOffTheLattice) {
    std::mt19937 random(2);
    std::uniform_real_distribution<double> uniform(0, 1);
    for (int trial = 0; trial < 20000; ++trial) {
        const Vec3d a(uniform(random) * 1e5, uniform(random) * 1e5, uniform(random) * 1e5);
        const Vec3d along = 1000.0 * Vec3d(uniform(random), uniform(random), uniform(random));
        const double height = std::pow(10.0, -12 * uniform(random));
        const Vec3d c = a + uniform(random) * along + height * Vec3d(uniform(random), 0, 1);
        const TriangleCorners t = {a, a + along, c};
        const Vec3d p = a + uniform(random) * along + 3.0 * Vec3d(0, uniform(random), 1);
        // No point of the triangle is further from an edge of it than the height.
        const double to_edges = slowDistance(p, {t[0], t[1], t[1]});
        EXPECT_NEAR(TriangleDistance(t).distance(p), to_edges, 3 * height + 1e-8);
    }
}

TEST(SquaredDistance, isNeverLessThanTheTruthByMoreThanItsSlack) {
    std::mt19937 random(3);
    const auto integer = [&](int range) {
        return float(int(random() % unsigned(range)) - range / 2);
    };
    for (int trial = 0; trial < 30000; ++trial) {
        const int size = 2 << (trial % 14);
        Vec3f corner[3];
        for (Vec3f& c : corner) c = Vec3f(integer(size), integer(size), integer(size));
        if (trial % 7 == 0) corner[2] = corner[1];
        if (trial % 7 == 1) corner[2] = corner[1] + Vec3f(1, 0, 0);
        const Vec3d n = glm::cross(Vec3d(corner[1] - corner[0]), Vec3d(corner[2] - corner[0]));
        const double length = glm::length(n);
        const LocalTriangle t = {corner[0], corner[1], corner[2],
                                 Vec3f(length > 0 ? n / length : Vec3d(0))};
        const Vec3f p(integer(2 * size) + 0.25f, integer(size), integer(size));
        const double found = std::sqrt(double(squaredDistance(p, t)));
        const double truth =
            slowDistance(Vec3d(p), {Vec3d(corner[0]), Vec3d(corner[1]), Vec3d(corner[2])});
        const double slack = double(kDistanceSlack) * size;
        EXPECT_GE(found, truth - slack);
        if (length > 0.1 * size * size) {  // no sliver
            EXPECT_LE(found, truth + slack);
        }
    }
}

}  // namespace
}  // namespace pietra
