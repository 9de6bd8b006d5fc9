#include "runtime/up_axis.h"

#include <algorithm>

namespace pietra {
namespace {

constexpr double kFlat = 0.35;   // of the other two sides
constexpr double kSlice = 0.05;  // of the height: what it stands on
constexpr double kMargin = 0.05;

Box3d boxOf(std::span<const Surface::Point> points, double below, int axis) {
    Box3d box;
    for (const Surface::Point& p : points)
        if (p.position[axis] <= below) box.add(p.position);
    return box;
}

/// How firmly the model stands along an axis: about 0 to 1.
double firmness(const Surface& surface, const Box3d& box, int axis) {
    const Vec3d size = box.max - box.min;
    const double below = box.min[axis] + kSlice * size[axis];
    const Box3d foot = boxOf(surface.points, below, axis);
    double area = 1;
    for (int other = 0; other < 3; ++other)
        if (other != axis && size[other] > 0)
            area *= (foot.max[other] - foot.min[other]) / size[other];
    double down = 0, up = 0;
    for (const Surface::Point& p : surface.points) {
        down += p.position[axis] <= below && p.normal[axis] < -0.9;
        up += p.normal[axis];
    }
    const auto count = double(surface.points.size());
    return area + 5 * down / count + 2 * std::max(0.0, up / count);
}

}  // namespace

UpAxis guessUpAxis(const Surface& surface) {
    if (surface.points.empty()) return UpAxis::kZ;
    Box3d box;
    for (const Surface::Point& p : surface.points) box.add(p.position);
    const Vec3d size = box.max - box.min;
    if (size.z < kFlat * std::min(size.x, size.y)) return UpAxis::kZ;
    if (size.y < kFlat * std::min(size.x, size.z)) return UpAxis::kY;
    return firmness(surface, box, 1) > firmness(surface, box, 2) + kMargin ? UpAxis::kY
                                                                           : UpAxis::kZ;
}

}  // namespace pietra
