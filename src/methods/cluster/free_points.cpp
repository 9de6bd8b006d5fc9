#include "methods/cluster/free_points.h"

#include <algorithm>
#include <cstdlib>

#include "base/check.h"
#include "geometry/lattice.h"

namespace pietra::cluster {

FreePoints::FreePoints(const Box3i& room, int shift, std::function<bool(const Vec3i&)> is_used)
    : room_(room), shift_(shift), is_used_(std::move(is_used)) {}

void FreePoints::occupy(std::span<const Vec3i> points) {
    for (const Vec3i& p : points) taken_.insert(latticeKey(p), 0);
}

bool FreePoints::take(const Vec3i& p) {
    return p == glm::clamp(p, room_.min, room_.max) && !(is_used_ && is_used_(p)) &&
           taken_.insert(latticeKey(p), 0).second;
}

Vec3i FreePoints::near(const Vec3i& wanted) {
    const int32_t step = 1 << shift_;
    const Vec3i first =
        glm::clamp(snapToShift(wanted, shift_), room_.min, room_.max) >> shift_ << shift_;
    for (int32_t reach = 0; reach <= kLatticeMax; reach += step)
        for (int32_t x = -reach; x <= reach; x += step)
            for (int32_t y = -reach; y <= reach; y += step)
                for (int32_t z = -reach; z <= reach; z += step) {
                    if (std::max({std::abs(x), std::abs(y), std::abs(z)}) != reach) continue;
                    if (const Vec3i p = first + Vec3i(x, y, z); take(p)) return p;
                }
    CHECK(false);
    return wanted;
}

void FreePoints::settle(LayerStep& step) {
    for (const MovedAnchor& moved : step.moved) {
        const Vec3i p = snapToShift(step.polygons.position[moved.vertex], shift_);
        step.polygons.position[moved.vertex] = step.triangles.mesh.position[moved.vertex] =
            take(p) ? p : moved.from;
    }
}

void FreePoints::placeStars(LayerTriangles& triangles) {
    for (const uint32_t v : triangles.to_free)
        triangles.mesh.position[v] = near(triangles.mesh.position[v]);
}

}  // namespace pietra::cluster
