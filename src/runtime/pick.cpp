#include "runtime/pick.h"

#include <cmath>
#include <limits>
#include <queue>

namespace pietra {
namespace {

constexpr double kNever = std::numeric_limits<double>::infinity();
/// So that no ray slips through between two triangles.
constexpr double kSlack = 1e-9;

/// Of a model's lattice; `direction` is of unit length.
struct Ray {
    Vec3d eye, direction;
};

/// Where the ray enters; 0 from within.
double entry(const Ray& ray, const Sphere& sphere) {
    const Vec3d to_centre = Vec3d(sphere.centre) - ray.eye;
    const double along = glm::dot(to_centre, ray.direction);
    const Vec3d off = to_centre - along * ray.direction;
    const double half_sq = double(sphere.radius) * double(sphere.radius) - glm::dot(off, off);
    if (sphere.radius < 0 || half_sq < 0) return kNever;
    const double half = std::sqrt(half_sq);
    return along + half < 0 ? kNever : std::max(0.0, along - half);
}

/// Moeller and Trumbore 1997, from both sides.
double meeting(const Ray& ray, const Vec3d& a, const Vec3d& b, const Vec3d& c) {
    const Vec3d ab = b - a, ac = c - a, p = glm::cross(ray.direction, ac);
    const double determinant = glm::dot(ab, p);
    if (determinant == 0) return kNever;
    const Vec3d from = ray.eye - a, q = glm::cross(from, ab);
    const double u = glm::dot(from, p) / determinant;
    const double v = glm::dot(ray.direction, q) / determinant;
    if (!(u >= -kSlack && v >= -kSlack && u + v <= 1 + kSlack)) return kNever;
    const double t = glm::dot(ac, q) / determinant;
    return t >= 0 ? t : kNever;
}

double meeting(const Ray& ray, const Mesh& mesh) {
    double nearest = kNever;
    for (const Triangle& t : mesh.triangle)
        nearest =
            std::min(nearest, meeting(ray, Vec3d(mesh.position[t[0]]), Vec3d(mesh.position[t[1]]),
                                      Vec3d(mesh.position[t[2]])));
    return nearest;
}

/// The distance along the ray, nodes nearest first.
double pick(const ModelReader& model, const Ray& ray) {
    using Entry = std::pair<double, NodeIndex>;
    std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
    const auto add = [&](NodeIndex i) {
        const Node& node = model.nodes()[i];
        if (node.is_joint) return;  // in no finest cut
        const double t = entry(ray, node.isLeaf() ? node.bounds : node.saturated);
        if (t < kNever) open.push({t, i});
    };
    const LevelRange roots = model.level(0);
    for (uint32_t i = 0; i < roots.count; ++i) add(roots.first + i);
    std::vector<Mesh> patches;
    uint32_t page = std::numeric_limits<uint32_t>::max();
    double nearest = kNever;
    while (!open.empty() && open.top().first < nearest) {
        const Node& node = model.nodes()[open.top().second];
        open.pop();
        if (!node.isLeaf()) {
            node.forEachChild(add);
            continue;
        }
        if (node.page != page) model.decode(page = node.page, patches);
        nearest = std::min(nearest, meeting(ray, patches[node.patch]));
    }
    return nearest;
}

}  // namespace

std::optional<Vec3d> pickFinest(std::span<const ModelReader* const> models, const Vec3d& eye,
                                const Vec3d& direction) {
    const Vec3d forward = glm::normalize(direction);
    double nearest = kNever;
    for (const ModelReader* model : models) {
        if (!model->hasPatches()) continue;
        const Lattice& lattice = model->info().lattice;
        const Ray ray{lattice.toLattice(eye), forward};
        nearest = std::min(nearest, pick(*model, ray) * lattice.step);
    }
    if (nearest == kNever) return {};
    return eye + nearest * forward;
}

}  // namespace pietra
