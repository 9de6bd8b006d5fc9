#include "runtime/eye_side.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "multires/cut.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

constexpr double kPi = 3.14159265358979323846;
/// What rounding and parts of components that are not marked as closed may leave.
constexpr double kMostOutside = 0.05;

/// Half the solid angle of a triangle seen from the origin, positive where it faces it.
double halfSolidAngle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double volume = glm::dot(a, glm::cross(b, c));
    return std::atan2(
        volume, la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
}

/// False only if the triangle is further than `distance` from the origin.
bool maybeWithin(const Vec3d& a, const Vec3d& b, const Vec3d& c, double distance) {
    const double reach = std::max(glm::length(b - a), glm::length(c - a));
    return glm::length(a) - reach <= distance;
}

}  // namespace

void EyeSide::add(const Node& node, const Mesh& patch) {
    if (!node.closed) return;
    double half_angle = 0;
    for (const Triangle& t : patch.triangle) {
        const Vec3d a = Vec3d(patch.position[t[0]]) - eye_;
        const Vec3d b = Vec3d(patch.position[t[1]]) - eye_;
        const Vec3d c = Vec3d(patch.position[t[2]]) - eye_;
        half_angle += halfSolidAngle(a, b, c);
        near_ |= maybeWithin(a, b, c, node.error);
    }
    winding_ += half_angle / (2 * kPi);
}

void EyeSide::add(const EyeSide& others) {
    winding_ += others.winding_;
    near_ |= others.near_;
}

bool EyeSide::mayBeInside() const {
    return near_ || std::abs(winding_) > kMostOutside;
}

bool eyeMayBeInside(const ModelReader& model, const View& view) {
    EyeSide side(view.eye());
    std::mutex mutex;
    std::vector<NodeIndex> closed = cutByView(model.nodes(), view, kEyeSidePixels).nodes;
    std::erase_if(closed, [&](NodeIndex i) { return !model.nodes()[i].closed; });
    visitPatches(model, closed, [&](NodeIndex i, const Mesh& mesh) {
        EyeSide part(view.eye());
        part.add(model.nodes()[i], mesh);
        const std::lock_guard lock(mutex);
        side.add(part);
    });
    return side.mayBeInside();
}

}  // namespace pietra
