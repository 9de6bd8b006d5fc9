#pragma once
// Distances from points to a triangle in single precision, as the deviation bound needs them: never
// below the true distance by more than rounding, whatever the triangle's shape.
//
// Coordinates are relative to a nearby lattice point, so that corners of triangles are exact in
// float and the error of a result is a few 2^-24 of the largest coordinate (kDistanceSlack covers
// it).

#include <algorithm>
#include <cmath>

#include "geometry/vec.h"

namespace pietra {

/// A result times 1 plus this factor times the largest coordinate involved is an upper bound.
inline constexpr float kDistanceSlack = 0x1p-19f;

/// A triangle in local coordinates with its unit normal (zero where it has no area).
struct LocalTriangle {
    Vec3f a, b, c;
    Vec3f normal;
};

/// Squared distance from `p` to the segment from `a` along `edge`.
inline float squaredDistanceToSegment(const Vec3f& p, const Vec3f& a, const Vec3f& edge) {
    const Vec3f w = p - a;
    const float length_sq = glm::dot(edge, edge);
    const float t = length_sq > 0 ? glm::dot(w, edge) / length_sq : 0.0f;
    const Vec3f offset = w - std::clamp(t, 0.0f, 1.0f) * edge;
    return glm::dot(offset, offset);
}

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
    return std::min({squaredDistanceToSegment(p, t.a, ab), squaredDistanceToSegment(p, t.b, bc),
                     squaredDistanceToSegment(p, t.c, ca)});
}

}  // namespace pietra
