#pragma once
// Boxes, spheres and normal cones, in whatever units their holder says.

#include <limits>

#include "geometry/vec.h"

namespace pietra {

/// Closed axis-aligned box; empty when min > max.
template <class V>
struct Box {
    V min{std::numeric_limits<typename V::value_type>::max()};
    V max{std::numeric_limits<typename V::value_type>::lowest()};
    bool empty() const { return min.x > max.x; }
    void add(const V& p) {
        min = glm::min(min, p);
        max = glm::max(max, p);
    }
    void add(const Box& other) {
        min = glm::min(min, other.min);
        max = glm::max(max, other.max);
    }
};
using Box3d = Box<Vec3d>;
using Box3i = Box<Vec3i>;

struct Sphere {
    Vec3f centre{0, 0, 0};
    float radius = -1;  ///< negative: empty
};

/// All normals n of a surface have dot(axis, n) >= cos_angle; cos_angle = -1 when nothing is known.
struct NormalCone {
    Vec3f axis{0, 0, 1};
    float cos_angle = -1;
};

}  // namespace pietra
