#include "multires/cut.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "base/check.h"
#include "base/hash.h"
#include "multires/forest.h"

namespace pietra {

namespace {

std::vector<NodeIndex> findRoots(std::span<const Node> nodes) {
    std::vector<uint8_t> has_parent(nodes.size(), 0);
    for (const Node& node : nodes)
        node.forEachChild([&](NodeIndex child) {
            CHECK_LT(child, nodes.size());
            has_parent[child] = 1;
        });
    std::vector<NodeIndex> roots;
    for (NodeIndex i = 0; i < nodes.size(); ++i)
        if (!has_parent[i]) roots.push_back(i);
    return roots;
}

enum class Visit { kDraw, kRefine, kSkip };

/// Top-down from the roots; `decide(node)` says what becomes of it. Leaves told to refine are
/// drawn.
template <class Decide>
Cut collectCut(std::span<const Node> nodes, Decide&& decide) {
    Cut cut;
    std::vector<NodeIndex> stack = findRoots(nodes);
    while (!stack.empty()) {
        const NodeIndex i = stack.back();
        stack.pop_back();
        const Node& node = nodes[i];
        const Visit visit = decide(i);
        if (visit == Visit::kSkip) continue;
        if (visit == Visit::kRefine && !node.isLeaf()) {
            node.forEachChild([&](NodeIndex child) { stack.push_back(child); });
            continue;
        }
        cut.nodes.push_back(i);
        cut.max_error = std::max(cut.max_error, node.error);
        cut.triangles += node.triangles;
    }
    std::sort(cut.nodes.begin(), cut.nodes.end());
    return cut;
}

template <class Refine>
Cut cutWhere(std::span<const Node> nodes, Refine&& refine) {
    return collectCut(nodes,
                      [&](NodeIndex i) { return refine(i) ? Visit::kRefine : Visit::kDraw; });
}

/// What refining groups from the largest error down adds.
struct Gain {
    float error;
    int64_t triangles;
};

std::vector<Gain> gainsOf(std::span<const Node> nodes) {
    std::vector<Gain> gains;
    for (const Node& node : nodes) {
        if (node.isLeaf() || node.is_joint) continue;
        Gain gain{node.error, -int64_t(node.triangles)};
        node.forEachChild([&](NodeIndex i) {
            const Node& child = nodes[i];
            if (child.is_joint && child.error >= node.error) return;  // never drawn
            gain.triangles += int64_t(child.triangles);
            if (child.is_joint) gains.push_back({child.error, -int64_t(child.triangles)});
        });
        gains.push_back(gain);
    }
    std::sort(gains.begin(), gains.end(),
              [](const Gain& a, const Gain& b) { return a.error > b.error; });
    return gains;
}

bool refineInView(const Node& node, const View& view, double pixels) {
    return !(view.pixelsOf(node) <= pixels);
}

/// The sphere shows with a diameter of at most half the tolerance, wherever it is in the picture.
bool tooSmall(const Sphere& sphere, const View& view, double pixels) {
    return sphere.radius >= 0 && view.errorInPixels(2 * sphere.radius, sphere) <= pixels / 2;
}

/// Random numbers that are the same everywhere, unlike the standard library's distributions.
class Dice {
public:
    explicit Dice(uint64_t seed) : state_(mixBits(seed ^ 0x9e3779b97f4a7c15ULL)) {}
    uint64_t bits() { return mixBits(state_ += 0x9e3779b97f4a7c15ULL); }
    /// In [0, 1).
    double real() { return double(bits() >> 11) * 0x1p-53; }
    double between(double low, double high) { return low + (high - low) * real(); }
    size_t index(size_t count) { return size_t(bits() % count); }
    Vec3d direction() {
        for (;;) {
            const Vec3d v(between(-1, 1), between(-1, 1), between(-1, 1));
            const double square = glm::dot(v, v);
            if (square > 1e-4 && square <= 1) return v / std::sqrt(square);
        }
    }

private:
    uint64_t state_;
};

Cut randomThresholdCut(std::span<const Node> nodes, Dice& dice) {
    const double error = nodes[dice.index(nodes.size())].error;
    return cutByError(nodes, dice.real() < 0.5 ? error : error * dice.between(0.3, 1.5));
}

Cut randomCameraCut(std::span<const Node> nodes, Dice& dice) {
    const Sphere& goal = nodes[dice.index(nodes.size())].bounds;
    const double distance = std::max(1.0, double(goal.radius)) * std::exp2(dice.between(-1, 5));
    Camera camera;
    camera.target = Vec3d(goal.centre);
    camera.eye = camera.target + distance * dice.direction();
    camera.up = dice.direction();
    camera.fovy_deg = dice.between(20, 90);
    const View view(camera, PictureSize{}, Lattice{});
    // Any node's own size on the screen makes a tolerance at which something changes.
    const Node& middle = nodes[dice.index(nodes.size())];
    const double size = view.errorInPixels(middle.error, middle.saturated);
    return cutByView(nodes, view, std::isfinite(size) && size > 0 ? size : 1);
}

Cut randomGroupsCut(std::span<const Node> nodes, Dice& dice) {
    const Forest forest(nodes);
    // A seldom chosen group takes all groups above it along, so small chances matter most.
    const double chance = std::exp2(-dice.between(0, 12));
    std::vector<uint8_t> refined(forest.groupCount());
    for (uint8_t& flag : refined) flag = dice.real() < chance;
    forest.closeUpward(refined);
    return cutWhere(nodes, [&](NodeIndex i) { return refined[forest.groupOf(i)] != 0; });
}

}  // namespace

bool branchInvisible(const Node& node, const View& view, double pixels, const Culling& culling) {
    return (culling.frustum && view.outside(node.saturated)) ||
           (culling.contribution && tooSmall(node.saturated, view, pixels));
}

bool patchInvisible(const Node& node, const View& view, double pixels, const Culling& culling) {
    return (culling.frustum && view.outside(node.bounds)) ||
           (culling.contribution && tooSmall(node.bounds, view, pixels)) ||
           (culling.cone && node.closed && view.facesAway(node.cone, node.bounds));
}

Cut rootCut(std::span<const Node> nodes) {
    return cutWhere(nodes, [](NodeIndex) { return false; });
}

Cut finestCut(std::span<const Node> nodes) {
    return cutWhere(nodes, [](NodeIndex) { return true; });
}

Cut cutByError(std::span<const Node> nodes, double max_error) {
    Cut cut = cutWhere(nodes, [&](NodeIndex i) { return !(nodes[i].error <= max_error); });
    if (cut.max_error <= max_error) return cut;
    cut = finestCut(nodes);
    cut.below_finest = true;
    return cut;
}

Cut cutByTriangles(std::span<const Node> nodes, uint64_t max_triangles) {
    const std::vector<Gain> gains = gainsOf(nodes);
    // Lower the threshold from one stated error to the next; refinement may even lose triangles, so
    // all thresholds are tried.
    Cut cut = rootCut(nodes);
    int64_t triangles = int64_t(cut.triangles);
    bool fits = cut.triangles <= max_triangles;
    double threshold = std::numeric_limits<double>::infinity();
    for (size_t k = 0; k < gains.size();) {
        const float error = gains[k].error;
        for (; k < gains.size() && gains[k].error == error; ++k) triangles += gains[k].triangles;
        if (triangles > int64_t(max_triangles)) continue;
        fits = true;
        // All that state `error` or more are refined, in float exactly.
        threshold = std::nextafter(error, -std::numeric_limits<float>::infinity());
    }
    if (fits && std::isinf(threshold)) return cut;
    if (fits) return cutWhere(nodes, [&](NodeIndex i) { return nodes[i].error > threshold; });
    cut.over_budget = true;
    return cut;
}

Cut cutByView(std::span<const Node> nodes, const View& view, double pixels) {
    return cutWhere(nodes, [&](NodeIndex i) { return refineInView(nodes[i], view, pixels); });
}

Cut cutByHeight(std::span<const Node> nodes, int height) {
    const Forest forest(nodes);
    const std::vector<uint16_t> heights = forest.groupHeights();
    return cutWhere(nodes, [&](NodeIndex i) { return heights[forest.groupOf(i)] > height; });
}

Cut visibleCut(std::span<const Node> nodes, const View& view, double pixels,
               const Culling& culling) {
    return collectCut(nodes, [&](NodeIndex i) {
        const Node& node = nodes[i];
        if (branchInvisible(node, view, pixels, culling)) return Visit::kSkip;
        if (!node.isLeaf() && refineInView(node, view, pixels)) return Visit::kRefine;
        return patchInvisible(node, view, pixels, culling) ? Visit::kSkip : Visit::kDraw;
    });
}

Cut randomCut(std::span<const Node> nodes, uint64_t seed) {
    if (nodes.empty()) return {};
    Dice dice(seed);
    switch (dice.index(3)) {
        case 0:
            return randomThresholdCut(nodes, dice);
        case 1:
            return randomCameraCut(nodes, dice);
        default:
            return randomGroupsCut(nodes, dice);
    }
}

std::string validateCut(std::span<const Node> nodes, std::span<const NodeIndex> cut) {
    const Forest forest(nodes);
    std::vector<uint8_t> drawn(nodes.size(), 0);
    for (const NodeIndex i : cut) {
        if (i >= nodes.size()) return fmt::format("node {} does not exist", i);
        if (drawn[i]) return fmt::format("node {} is drawn twice", i);
        drawn[i] = 1;
    }
    // Down from the roots: `refined` are the nodes strictly above the cut.
    std::vector<uint8_t> refined(nodes.size(), 0);
    size_t met = 0;
    std::vector<NodeIndex> stack = forest.roots();
    while (!stack.empty()) {
        const NodeIndex i = stack.back();
        stack.pop_back();
        if (drawn[i]) {
            ++met;
            continue;
        }
        if (nodes[i].isLeaf()) return fmt::format("nothing is drawn above leaf {}", i);
        refined[i] = 1;
        nodes[i].forEachChild([&](NodeIndex child) { stack.push_back(child); });
    }
    if (met != cut.size()) {
        for (const NodeIndex i : cut)
            for (NodeIndex p = forest.parent(i); p != kNoNode; p = forest.parent(p))
                if (drawn[p]) return fmt::format("node {} is drawn and so is {} above it", i, p);
    }
    for (uint32_t g = 0; g < forest.groupCount(); ++g) {
        // A joint below what is drawn says nothing.
        NodeIndex first = kNoNode;
        for (const NodeIndex i : forest.members(g)) {
            if (nodes[i].is_joint && !drawn[i] && !refined[i]) continue;
            if (first == kNoNode) first = i;
            if (refined[i] != refined[first])
                return fmt::format("group {} is refined at node {} but not at node {}",
                                   nodes[i].group, refined[i] ? i : first, refined[i] ? first : i);
        }
    }
    return {};
}

}  // namespace pietra
