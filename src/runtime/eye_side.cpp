#include "runtime/eye_side.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "geometry/triangle_distance.h"
#include "multires/cut.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

constexpr double kPi = 3.14159265358979323846;
/// A whole number whose absolute value is below this is 0, with room for rounding and for nodes
/// whose surface is not quite closed.
constexpr double kMostOutside = 0.5;

/// Half the solid angle of a triangle seen from the origin, positive where it faces it.
double halfSolidAngle(const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const double la = glm::length(a), lb = glm::length(b), lc = glm::length(c);
    const double volume = glm::dot(a, glm::cross(b, c));
    return std::atan2(
        volume, la * lb * lc + glm::dot(a, b) * lc + glm::dot(b, c) * la + glm::dot(c, a) * lb);
}

/// The distance of the origin to the triangle, or `enough`, if that is less.
double clearanceOf(const Vec3d& a, const Vec3d& b, const Vec3d& c, double enough) {
    const Vec3d ab = b - a, ac = c - a;
    const double reach = std::sqrt(std::max(glm::dot(ab, ab), glm::dot(ac, ac)));
    if (glm::length(a) - reach >= enough) return enough;
    return TriangleDistance({a, b, c}).distance({0, 0, 0});
}

}  // namespace

Box3d closedPartsWithin(const ModelInfo& info, std::span<const Node> nodes) {
    double error = 0;
    bool any = false;
    for (const Node& node : nodes) {
        error = std::max(error, double(node.error));
        any |= node.closed;
    }
    if (!any) return {};
    return {Vec3d(info.bounds.min) - error - 1.0, Vec3d(info.bounds.max) + error + 1.0};
}

bool holds(const Box3d& box, const Vec3d& point) {
    return glm::clamp(point, box.min, box.max) == point && !box.empty();
}

void EyeSide::add(const Node& node, const Mesh& patch) {
    double half_angle = 0, half_angles = 0;
    for (const Triangle& t : patch.triangle) {
        const Vec3d a = Vec3d(patch.position[t[0]]) - eye_;
        const Vec3d b = Vec3d(patch.position[t[1]]) - eye_;
        const Vec3d c = Vec3d(patch.position[t[2]]) - eye_;
        const double half = halfSolidAngle(a, b, c);
        half_angle += half;
        half_angles += std::abs(half);
        // The model is within the error, and what is finer within as much of the model.
        clearance_ = std::min(clearance_,
                              clearanceOf(a, b, c, clearance_ + 2 * node.error) - 2 * node.error);
    }
    (node.closed ? winding_ : unknown_) += (node.closed ? half_angle : half_angles) / (2 * kPi);
}

void EyeSide::add(const EyeSide& others) {
    winding_ += others.winding_;
    unknown_ += others.unknown_;
    clearance_ = std::min(clearance_, others.clearance_);
}

bool EyeSide::mayBeInside() const {
    return clearance_ <= 0 || std::abs(winding_) + unknown_ > kMostOutside;
}

bool eyeMayBeInside(const ModelReader& model, const View& view) {
    if (!holds(closedPartsWithin(model.info(), model.nodes()), view.eye())) return false;
    EyeSide side(view.eye());
    std::mutex mutex;
    visitPatches(model, cutByView(model.nodes(), view, kEyeSidePixels).nodes,
                 [&](NodeIndex i, const Mesh& mesh) {
                     EyeSide part(view.eye());
                     part.add(model.nodes()[i], mesh);
                     const std::lock_guard lock(mutex);
                     side.add(part);
                 });
    return side.mayBeInside();
}

}  // namespace pietra
