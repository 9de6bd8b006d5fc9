#include "runtime/eye_side.h"

#include <algorithm>
#include <cmath>
#include <mutex>

#include "multires/cut.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

constexpr double kPi = 3.14159265358979323846;
/// Tolerance of the cut that is looked at, in pixels: coarse, but whole near the eye.
constexpr double kCoarsePixels = 64;
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

bool eyeMayBeInside(const ModelReader& model, const View& view) {
    std::vector<NodeIndex> closed;
    for (const NodeIndex i : cutByView(model.nodes(), view, kCoarsePixels).nodes) {
        const Node& node = model.nodes()[i];
        if (node.closed && node.triangles > 0) closed.push_back(i);
    }
    double winding = 0;
    bool near = false;
    std::mutex mutex;
    visitPatches(model, closed, [&](NodeIndex i, const Mesh& mesh) {
        const Node& node = model.nodes()[i];
        double sum = 0;
        bool near_here = false;
        for (const Triangle& t : mesh.triangle) {
            const Vec3d a = Vec3d(mesh.position[t[0]]) - view.eye();
            const Vec3d b = Vec3d(mesh.position[t[1]]) - view.eye();
            const Vec3d c = Vec3d(mesh.position[t[2]]) - view.eye();
            sum += halfSolidAngle(a, b, c);
            near_here |= maybeWithin(a, b, c, node.error);
        }
        const std::lock_guard lock(mutex);
        winding += sum / (2 * kPi);
        near |= near_here;
    });
    return near || std::abs(winding) > kMostOutside;
}

}  // namespace pietra
