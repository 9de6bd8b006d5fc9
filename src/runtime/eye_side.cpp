#include "runtime/eye_side.h"

#include <algorithm>
#include <array>
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

/// A vertex as the eye sees it.
struct Ray {
    Vec3d direction;  // of unit length
    double distance;
};

/// A sum of angles, each below pi: the argument of the product of complex numbers that have them,
/// and how often it has gone round. No arc tangent is needed but for the sum.
class AngleSum {
public:
    /// The angle of (x, y).
    void add(double x, double y) {
        const double re = re_ * x - im_ * y, im = re_ * y + im_ * x;
        if (y > 0 && im_ >= 0 && im < 0) ++turns_;
        if (y < 0 && im_ < 0 && im >= 0) --turns_;
        const double size = std::abs(re) + std::abs(im);
        if (size == 0) return;  // seen edge on, from within: neither side
        re_ = re / size;
        im_ = im / size + 0.0;  // no negative zero
    }
    double sum() const { return std::atan2(im_, re_) + 2 * kPi * turns_; }

private:
    double re_ = 1, im_ = 0;
    int turns_ = 0;
};

/// The distance of the origin to the triangle, or `enough`, if that is less.
double clearanceOf(const std::array<Vec3d, 3>& t, double first_distance, double enough) {
    const Vec3d ab = t[1] - t[0], ac = t[2] - t[0];
    const double reach_sq = std::max(glm::dot(ab, ab), glm::dot(ac, ac));
    const double beyond = first_distance - enough;
    if (beyond > 0 && beyond * beyond >= reach_sq) return enough;
    return TriangleDistance(t).distance({0, 0, 0});
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
    thread_local std::vector<Ray> ray;
    ray.clear();
    for (const Vec3i& p : patch.position) {
        const Vec3d d = Vec3d(p) - eye_;
        const double distance = glm::length(d);
        ray.push_back({distance > 0 ? d / distance : d, distance});
    }
    AngleSum half_angles;
    for (const Triangle& t : patch.triangle) {
        const Ray &a = ray[t[0]], &b = ray[t[1]], &c = ray[t[2]];
        const double volume = glm::dot(a.direction, glm::cross(b.direction, c.direction));
        half_angles.add(1 + glm::dot(a.direction, b.direction) +
                            glm::dot(b.direction, c.direction) + glm::dot(c.direction, a.direction),
                        node.closed ? volume : std::abs(volume));
        // The model is within the error, and what is finer within as much of the model.
        const double error = 2 * double(node.error);
        clearance_ = std::min(clearance_, clearanceOf({Vec3d(patch.position[t[0]]) - eye_,
                                                       Vec3d(patch.position[t[1]]) - eye_,
                                                       Vec3d(patch.position[t[2]]) - eye_},
                                                      a.distance, clearance_ + error) -
                                              error);
    }
    (node.closed ? winding_ : unknown_) += half_angles.sum() / (2 * kPi);
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
    visitPatches(model, cutByView(model.nodes(), view.byError(), kEyeSidePixels).nodes,
                 [&](NodeIndex i, const Mesh& mesh) {
                     EyeSide part(view.eye());
                     part.add(model.nodes()[i], mesh);
                     const std::lock_guard lock(mutex);
                     side.add(part);
                 });
    return side.mayBeInside();
}

}  // namespace pietra
