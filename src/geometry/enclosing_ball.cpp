#include "geometry/enclosing_ball.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace pietra {

namespace {

struct Ball {
    Vec3d centre{0, 0, 0};
    double squared = -1;  // squared radius
    bool contains(const Vec3d& p) const {
        const Vec3d d = p - centre;
        return glm::dot(d, d) <= squared * (1 + 1e-12);
    }
};

/// Smallest ball with all of at most four points on its surface.
Ball circumscribed(const Vec3d* p, int count) {
    if (count == 0) return {};
    if (count == 1) return {p[0], 0};
    // centre = p0 + sum of l_i * q_i with q_i = p_i - p0, and 2 q_i . (centre - p0) = q_i . q_i:
    // solved by elimination on the Gram matrix; a dependent point leaves a zero pivot and is
    // skipped.
    const int n = count - 1;
    double m[3][4];
    Vec3d q[3];
    for (int i = 0; i < n; ++i) q[i] = p[i + 1] - p[0];
    for (int i = 0; i < n; ++i) {
        for (int j = 0; j < n; ++j) m[i][j] = 2 * glm::dot(q[i], q[j]);
        m[i][n] = glm::dot(q[i], q[i]);
    }
    bool used[3] = {};
    for (int i = 0; i < n; ++i) {
        if (!(m[i][i] > 1e-12 * glm::dot(q[i], q[i]))) continue;
        used[i] = true;
        for (int r = 0; r < n; ++r) {
            if (r == i) continue;
            const double factor = m[r][i] / m[i][i];
            for (int c = 0; c <= n; ++c) m[r][c] -= factor * m[i][c];
        }
    }
    Vec3d offset(0);
    for (int i = 0; i < n; ++i)
        if (used[i]) offset += m[i][n] / m[i][i] * q[i];
    return {p[0] + offset, glm::dot(offset, offset)};
}

/// Welzl's recursion with move to front, on the few pivots.
Ball smallest(std::vector<Vec3d>& points, size_t count, Vec3d* support, int support_count) {
    Ball ball = circumscribed(support, support_count);
    if (support_count == 4) return ball;
    for (size_t i = 0; i < count; ++i) {
        if (ball.contains(points[i])) continue;
        support[support_count] = points[i];
        ball = smallest(points, i, support, support_count + 1);
        std::rotate(points.begin(), points.begin() + ptrdiff_t(i),
                    points.begin() + ptrdiff_t(i) + 1);
    }
    return ball;
}

/// Rounds the centre to float, then the radius up so that `reach(centre)`, the distance to the
/// farthest thing to enclose, is within it.
template <class Reach>
Sphere roundedUp(const Vec3d& centre, Reach&& reach) {
    Sphere sphere;
    sphere.centre = Vec3f(centre);
    const double radius = reach(Vec3d(sphere.centre)) * (1 + 1e-9);
    sphere.radius = std::nextafter(float(radius), std::numeric_limits<float>::infinity());
    return sphere;
}

template <class V>
Ball ballOfPoints(std::span<const V> points) {
    std::vector<Vec3d> pivots;
    Ball ball;
    const size_t most_rounds = 40;  // some ten are usual; what is left goes into the radius
    for (size_t round = 0; round < most_rounds; ++round) {
        double worst = ball.squared * (1 + 1e-7);
        const V* farthest = nullptr;
        for (const V& p : points) {
            const Vec3d d = Vec3d(p) - ball.centre;
            const double squared = glm::dot(d, d);
            if (squared > worst) {
                worst = squared;
                farthest = &p;
            }
        }
        if (!farthest) break;
        pivots.insert(pivots.begin(), Vec3d(*farthest));
        Vec3d support[4];
        ball = smallest(pivots, pivots.size(), support, 0);
    }
    return ball;
}

template <class V>
Sphere enclosePoints(std::span<const V> points) {
    if (points.empty()) return {};
    return roundedUp(ballOfPoints(points).centre, [&](const Vec3d& centre) {
        double squared = 0;
        for (const V& p : points) {
            const Vec3d d = Vec3d(p) - centre;
            squared = std::max(squared, glm::dot(d, d));
        }
        return std::sqrt(squared);
    });
}

}  // namespace

Sphere enclosingBall(std::span<const Vec3i> points) {
    return enclosePoints(points);
}
Sphere enclosingBall(std::span<const Vec3f> points) {
    return enclosePoints(points);
}

Sphere enclosingBall(std::span<const Sphere> balls) {
    Vec3d centre(0);
    bool any = false;
    const auto farthest = [&](const Vec3d& c, Vec3d* towards) {
        double reach = 0;
        for (const Sphere& ball : balls) {
            if (ball.radius < 0) continue;
            const Vec3d d = Vec3d(ball.centre) - c;
            const double length = glm::length(d);
            if (length + ball.radius >= reach) {
                reach = length + ball.radius;
                if (towards) *towards = length > 0 ? d * (reach / length) : Vec3d(0);
            }
        }
        return reach;
    };
    const Sphere* largest = nullptr;
    for (const Sphere& ball : balls)
        if (ball.radius >= 0 && (!any || ball.radius > largest->radius)) {
            largest = &ball;
            any = true;
        }
    if (!any) return {};
    // Start in the largest ball, step towards the farthest point with shrinking steps; keep the
    // best.
    centre = Vec3d(largest->centre);
    Vec3d best = centre;
    double best_reach = farthest(centre, nullptr);
    for (int i = 1; i <= 300 && best_reach > largest->radius; ++i) {
        Vec3d towards(0);
        const double reach = farthest(centre, &towards);
        if (reach < best_reach) {
            best_reach = reach;
            best = centre;
        }
        centre += towards / double(i + 1);
    }
    return roundedUp(best, [&](const Vec3d& c) { return farthest(c, nullptr); });
}

NormalCone enclosingCone(std::span<const Vec3f> normals) {
    NormalCone cone;
    if (normals.empty()) return cone;
    const Vec3d centre = ballOfPoints(normals).centre;
    const double length = glm::length(centre);
    if (!(length > 1e-3)) return cone;
    cone.axis = Vec3f(centre / length);
    double lowest = 1;
    for (const Vec3f& n : normals) lowest = std::min(lowest, glm::dot(Vec3d(cone.axis), Vec3d(n)));
    cone.cos_angle = float(std::max(-1.0, lowest - 1e-6));
    return cone;
}

}  // namespace pietra
