#pragma once
// The distance from points to a triangle, in two precisions. Segments and points as degenerate
// triangles are fine.
//
// - squaredDistance() in float, for the builder, which needs millions of them on triangles that it
//   meets once: rounding and misjudgement may make it larger, never smaller by more than the slack,
//   so bounds stay bounds. Coordinates are relative to a nearby lattice point: corners are exact
//   then.
// - TriangleDistance in double, for the audit, which must not share the builder's errors, on
//   lattice or input coordinates as they are: prepared once for many points, the error stays below
//   1e-8 lattice units also for slivers.
// What they have in common is the way to an edge.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/vec.h"

namespace pietra {

/// Squared length of the way to a segment, from a point at `w` from its start, whose foot on the
/// line lies at `t` times `edge`.
template <class Vector, class Scalar>
Scalar squaredDistanceToSegment(const Vector& w, const Vector& edge, Scalar t) {
    const Vector rest = w - std::clamp(t, Scalar(0), Scalar(1)) * edge;
    return glm::dot(rest, rest);
}

/// The result of squaredDistance(), times 1 plus this factor times the largest coordinate involved,
/// is an upper bound.
inline constexpr float kDistanceSlack = 0x1p-19f;

/// A triangle in local coordinates with its unit normal (zero where it has no area).
struct LocalTriangle {
    Vec3f a, b, c;
    Vec3f normal;
};

/// Squared distance from `p` to the closed triangle. Every value returned is the distance to a
/// point that is on the triangle but for rounding, so an error of judgement can only make it
/// larger.
inline float squaredDistance(const Vec3f& p, const LocalTriangle& t) {
    const Vec3f ab = t.b - t.a, bc = t.c - t.b, ca = t.a - t.c;
    const Vec3f& n = t.normal;
    const bool inside = glm::dot(glm::cross(n, ab), p - t.a) >= 0 &&
                        glm::dot(glm::cross(n, bc), p - t.b) >= 0 &&
                        glm::dot(glm::cross(n, ca), p - t.c) >= 0 && glm::dot(n, n) > 0.5f;
    if (inside) {
        const float height = glm::dot(n, p - t.a);
        return height * height;
    }
    const auto toEdge = [&p](const Vec3f& from, const Vec3f& edge) {
        const Vec3f w = p - from;
        const float length_sq = glm::dot(edge, edge);
        return squaredDistanceToSegment(w, edge,
                                        length_sq > 0 ? glm::dot(w, edge) / length_sq : 0.0f);
    };
    return std::min({toEdge(t.a, ab), toEdge(t.b, bc), toEdge(t.c, ca)});
}

/// Corners in lattice coordinates, not necessarily integers.
using TriangleCorners = std::array<Vec3d, 3>;

class TriangleDistance {
public:
    explicit TriangleDistance(const TriangleCorners& corners) : corner_(corners) {
        double longest_sq = 0;
        for (int k = 0; k < 3; ++k) {
            edge_[k] = corner_[(k + 1) % 3] - corner_[k];
            const double length_sq = glm::dot(edge_[k], edge_[k]);
            inverse_sq_[k] = length_sq > 0 ? 1 / length_sq : 0;
            longest_sq = std::max(longest_sq, length_sq);
        }
        normal_ = glm::cross(edge_[0], edge_[1]);
        const double normal_sq = glm::dot(normal_, normal_);
        flat_ = !(normal_sq > 0);
        if (flat_) return;
        inverse_normal_ = 1 / std::sqrt(normal_sq);
        for (int k = 0; k < 3; ++k) inward_[k] = glm::cross(normal_, edge_[k]);
        // A sliver's normal may be off, but then its edges are a good answer: see distance().
        const double height_sq = normal_sq / longest_sq;
        sliver_height_ = height_sq < 1e-10 * longest_sq ? std::sqrt(height_sq) : -1;
    }

    double distance(const Vec3d& p) const {
        if (flat_ || !isAbove(p)) return distanceToEdges(p);
        const double to_plane = std::abs(glm::dot(normal_, p - corner_[0])) * inverse_normal_;
        if (sliver_height_ < 0) return to_plane;
        // No point of the triangle is further from its edges than its height.
        const double to_edges = distanceToEdges(p);
        return std::clamp(to_plane, std::max(0.0, to_edges - sliver_height_), to_edges);
    }

private:
    bool isAbove(const Vec3d& p) const {
        for (int k = 0; k < 3; ++k)
            if (glm::dot(inward_[k], p - corner_[k]) < 0) return false;
        return true;
    }

    double distanceToEdges(const Vec3d& p) const {
        double least_sq = std::numeric_limits<double>::infinity();
        for (int k = 0; k < 3; ++k) {
            const Vec3d w = p - corner_[k];
            const double t = glm::dot(w, edge_[k]) * inverse_sq_[k];
            least_sq = std::min(least_sq, squaredDistanceToSegment(w, edge_[k], t));
        }
        return std::sqrt(least_sq);
    }

    std::array<Vec3d, 3> corner_, edge_, inward_;  // inward_: in the plane, across the edge
    std::array<double, 3> inverse_sq_;
    Vec3d normal_;
    double inverse_normal_ = 0;
    double sliver_height_ = -1;
    bool flat_ = false;
};

}  // namespace pietra
