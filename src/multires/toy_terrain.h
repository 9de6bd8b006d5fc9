#pragma once
// A complete little model for tests: a square height field as a hierarchy of right triangles, the
// flat sibling of Adaptive TetraPuzzles. A diamond is the one or two triangles that share a
// hypotenuse; a patch is its triangle bisected twice, so that patches of neighbours match in every
// valid cut. Stated errors are proven: the largest difference in height from the finest cut, over
// the same triangle, saturated. Deterministic in the settings; everything is held in memory.

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <vector>

#include "base/check.h"
#include "base/hash.h"
#include "multires/forest.h"

namespace pietra {

struct ToyTerrainSettings {
    uint64_t seed = 1;
    int depth = 8;               ///< levels of bisection at most
    double keep_refining = 0.8;  ///< chance of a diamond to be refined (and so all above it)
    int32_t spacing = 64;        ///< lattice units between neighbouring grid points
    int32_t roughness = 40;      ///< largest random height of the coarsest octave, in `spacing`/16
    float quantisation_error = 0.25f;  ///< counts in every stated error
};

struct ToyTerrain {
    std::vector<Node> nodes;
    std::vector<Mesh> patches;  ///< one a node
};

namespace toy {

/// Apex, and the two ends of the hypotenuse, counter-clockwise, on the grid.
using Corners = std::array<Vec2i, 3>;

inline Vec2i middle(const Corners& t) {
    return (t[1] + t[2]) / 2;
}

inline std::array<Corners, 2> bisect(const Corners& t) {
    const Vec2i m = middle(t);
    return {Corners{m, t[0], t[1]}, Corners{m, t[2], t[0]}};
}

class Builder {
public:
    explicit Builder(const ToyTerrainSettings& settings)
        : settings_(settings), size_(1 << ((settings.depth + 3) / 2)) {}

    ToyTerrain build() {
        chooseDiamonds();
        const Vec2i a(0, 0), b(size_, 0), c(size_, size_), d(0, size_);
        addNode({b, c, a}, 0);
        addNode({d, a, c}, 0);
        for (size_t i = 0; i < corners_.size(); ++i) refine(NodeIndex(i));
        for (NodeIndex i = 0; i < corners_.size(); ++i) model_.patches.push_back(makePatch(i));
        for (NodeIndex i = 0; i < corners_.size(); ++i) describe(i);
        stateErrorsAndSpheres();
        return std::move(model_);
    }

private:
    using DiamondKey = std::array<int, 3>;  // level, middle of the hypotenuse

    static DiamondKey keyOf(const Corners& t, int level) {
        const Vec2i m = middle(t);
        return {level, m.x, m.y};
    }

    double chance(uint64_t a, uint64_t b, uint64_t c) const {
        return double(mixBits(mixBits(mixBits(a + settings_.seed * 977) + b) + c) >> 11) * 0x1p-53;
    }

    int32_t height(const Vec2i& p) const {
        double sum = 0, amplitude = settings_.roughness * settings_.spacing / 16.0;
        for (int cell = size_; cell > 0; cell /= 2, amplitude *= 0.55) {
            const Vec2i q = p / cell * cell;
            const double u = double(p.x - q.x) / cell, v = double(p.y - q.y) / cell;
            const auto noise = [&](int x, int y) {
                return chance(uint64_t(cell), uint64_t(q.x + x * cell), uint64_t(q.y + y * cell));
            };
            sum += amplitude * ((1 - u) * (1 - v) * noise(0, 0) + u * (1 - v) * noise(1, 0) +
                                (1 - u) * v * noise(0, 1) + u * v * noise(1, 1));
        }
        return int32_t(std::floor(sum));
    }

    Vec3i point(const Vec2i& p) const {
        return {p.x * settings_.spacing, p.y * settings_.spacing, 1000 + height(p)};
    }

    /// Marks random diamonds of the complete hierarchy and all those above them.
    void chooseDiamonds() {
        const Vec2i a(0, 0), b(size_, 0), c(size_, size_), d(0, size_);
        chooseBelow({b, c, a}, 0);
        chooseBelow({d, a, c}, 0);
        // A refined diamond needs all its triangles, hence the diamonds of their parents; the
        // parents of a triangle lie one level up, so one sweep from fine to coarse closes the set.
        for (int level = settings_.depth - 1; level > 0; --level)
            for (const auto& [key, above] : parents_)
                if (key[0] == level && refined_[key])
                    for (const DiamondKey& parent : above) refined_[parent] = true;
    }

    void chooseBelow(const Corners& t, int level) {
        const DiamondKey key = keyOf(t, level);
        refined_[key] =
            level < settings_.depth &&
            chance(uint64_t(level), uint64_t(key[1]), uint64_t(key[2])) < settings_.keep_refining;
        if (level == settings_.depth) return;
        for (const Corners& child : bisect(t)) {
            parents_[keyOf(child, level + 1)].push_back(key);
            chooseBelow(child, level + 1);
        }
    }

    NodeIndex addNode(const Corners& t, int level) {
        Node node;
        node.level = uint16_t(level);
        node.group = groups_.try_emplace(keyOf(t, level), uint32_t(groups_.size())).first->second;
        model_.nodes.push_back(node);
        corners_.push_back(t);
        return NodeIndex(corners_.size() - 1);
    }

    void refine(NodeIndex i) {
        const int level = model_.nodes[i].level;
        if (level >= settings_.depth || !refined_[keyOf(corners_[i], level)]) return;
        const std::array<Corners, 2> halves = bisect(corners_[i]);
        for (int k = 0; k < 2; ++k) {
            const NodeIndex child = addNode(halves[k], level + 1);
            model_.nodes[i].child[k] = child;
        }
    }

    Mesh makePatch(NodeIndex i) const {
        Mesh mesh;
        std::map<std::array<int, 2>, uint32_t> index;
        for (const Corners& half : bisect(corners_[i]))
            for (const Corners& quarter : bisect(half)) addTriangle(quarter, index, mesh);
        mesh.normal.resize(mesh.position.size(), encodeNormal({0, 0, 1}));
        return mesh;
    }

    void addTriangle(const Corners& t, std::map<std::array<int, 2>, uint32_t>& index,
                     Mesh& mesh) const {
        Triangle triangle;
        unsigned edge_class = 0;
        for (unsigned k = 0; k < 3; ++k) {
            const auto [it, is_new] =
                index.try_emplace({t[k].x, t[k].y}, uint32_t(mesh.position.size()));
            if (is_new) mesh.position.push_back(point(t[k]));
            triangle[k] = it->second;
            const Vec2i p = t[k], q = t[(k + 1) % 3];
            const bool border = (p.x == q.x && (p.x == 0 || p.x == size_)) ||
                                (p.y == q.y && (p.y == 0 || p.y == size_));
            edge_class |= unsigned(border ? EdgeClass::kBorder : EdgeClass::kManifold) << (2 * k);
        }
        mesh.triangle.push_back(triangle);
        mesh.edge_class.push_back(uint8_t(edge_class));
    }

    static Sphere sphereAround(const std::vector<Sphere>& parts) {
        Box3d box;
        for (const Sphere& part : parts) box.add(Vec3d(part.centre));
        const Vec3f centre((box.min + box.max) * 0.5);
        double radius = 0;
        for (const Sphere& part : parts)
            radius = std::max(
                radius, glm::length(Vec3d(part.centre) - Vec3d(centre)) + double(part.radius));
        return {centre, float(radius * (1 + 1e-6))};
    }

    void describe(NodeIndex i) {
        Node& node = model_.nodes[i];
        const Mesh& mesh = model_.patches[i];
        node.patch = uint16_t(i);
        node.triangles = uint32_t(mesh.triangleCount());
        node.vertices = uint32_t(mesh.vertexCount());
        std::vector<Sphere> points;
        for (const Vec3i& p : mesh.position) points.push_back({Vec3f(p), 0});
        node.bounds = sphereAround(points);
        node.cone = coneOf(mesh);
    }

    static NormalCone coneOf(const Mesh& mesh) {
        std::vector<Vec3d> normals;
        Vec3d sum(0);
        for (const Triangle& t : mesh.triangle) {
            const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
            normals.push_back(glm::normalize(glm::cross(b - a, c - a)));
            sum += normals.back();
        }
        const Vec3f axis(glm::normalize(sum));
        double cosine = 1;
        for (const Vec3d& n : normals) cosine = std::min(cosine, glm::dot(n, Vec3d(axis)));
        return {axis, float(cosine - 1e-5)};
    }

    /// Height of the coarse patch minus that of a fine vertex within it, its absolute value.
    static double heightAbove(const Mesh& coarse, const Vec3i& p) {
        double best_outside = 1e30, difference = 0;
        for (const Triangle& t : coarse.triangle) {
            const Vec3d a(coarse.position[t[0]]), b(coarse.position[t[1]]),
                c(coarse.position[t[2]]), q(p);
            const auto area = [](const Vec3d& u, const Vec3d& v, const Vec3d& w) {
                return (v.x - u.x) * (w.y - u.y) - (v.y - u.y) * (w.x - u.x);
            };
            const double whole = area(a, b, c);
            const double wa = area(q, b, c) / whole, wb = area(a, q, c) / whole;
            const double outside = -std::min({wa, wb, 1 - wa - wb, 0.0});
            if (outside >= best_outside) continue;
            best_outside = outside;
            difference = std::abs(wa * a.z + wb * b.z + (1 - wa - wb) * c.z - q.z);
        }
        CHECK_LT(best_outside, 1e-9);
        return difference;
    }

    double deviationBelow(const Mesh& coarse, NodeIndex i) const {
        double worst = 0;
        if (model_.nodes[i].isLeaf())
            for (const Vec3i& p : model_.patches[i].position)
                worst = std::max(worst, heightAbove(coarse, p));
        for (const NodeIndex child : model_.nodes[i].child)
            if (child != kNoNode) worst = std::max(worst, deviationBelow(coarse, child));
        return worst;
    }

    /// Children come after their parents, and all of a group are of one level, in level order.
    void stateErrorsAndSpheres() {
        const Forest forest(model_.nodes);
        for (int level = settings_.depth; level >= 0; --level)
            for (uint32_t g = 0; g < forest.groupCount(); ++g)
                if (forest.node(forest.members(g).front()).level == level) stateGroup(forest, g);
    }

    void stateGroup(const Forest& forest, uint32_t g) {
        double error = 0;
        std::vector<Sphere> parts;
        for (const NodeIndex i : forest.members(g)) {
            error = std::max(error, deviationBelow(model_.patches[i], i));
            parts.push_back(model_.nodes[i].bounds);
            for (const NodeIndex child : model_.nodes[i].child) {
                if (child == kNoNode) continue;
                parts.push_back(model_.nodes[child].saturated);
                error = std::max<double>(error,
                                         model_.nodes[child].error - settings_.quantisation_error);
            }
        }
        const Sphere sphere = sphereAround(parts);
        for (const NodeIndex i : forest.members(g)) {
            model_.nodes[i].error = float(error * (1 + 1e-6)) + settings_.quantisation_error;
            model_.nodes[i].saturated = sphere;
            // Bisection halves areas, whatever the errors are.
            model_.nodes[i].face_size =
                float(size_ * settings_.spacing) * std::exp2f(-model_.nodes[i].level / 2.0f);
        }
    }

    ToyTerrainSettings settings_;
    int size_;
    std::map<DiamondKey, bool> refined_;
    std::map<DiamondKey, std::vector<DiamondKey>> parents_;
    std::map<DiamondKey, uint32_t> groups_;
    std::vector<Corners> corners_;
    ToyTerrain model_;
};

}  // namespace toy

inline ToyTerrain makeToyTerrain(const ToyTerrainSettings& settings = {}) {
    return toy::Builder(settings).build();
}

}  // namespace pietra
