#include "multires/forest.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"

namespace pietra {

namespace {

/// Parents of all nodes, or the first bad link.
struct Links {
    std::vector<NodeIndex> parent;
    uint64_t count = 0;
    uint64_t bad = 0;
    std::string fault;
};

void noteFault(std::string& first, std::string text) {
    if (first.empty()) first = std::move(text);
}

void linkChild(std::span<const Node> nodes, NodeIndex i, NodeIndex child, Links& links) {
    if (child == kNoNode) return;
    ++links.count;
    if (child >= nodes.size()) {
        ++links.bad;
        noteFault(links.fault, fmt::format("node {}: child {} does not exist", i, child));
    } else if (links.parent[child] != kNoNode) {
        ++links.bad;
        noteFault(links.fault, fmt::format("node {}: child {} has another parent, {}", i, child,
                                           links.parent[child]));
    } else {
        links.parent[child] = i;
    }
}

/// Also true of what is none: children are looked at one by one then.
bool isRange(std::span<const Node> nodes, NodeIndex i, Links& links) {
    const Node& node = nodes[i];
    if (!node.child_range || (node.child[0] <= node.child[1] && node.child[1] < nodes.size()))
        return true;
    ++links.bad;
    noteFault(links.fault, fmt::format("node {}: its range of children does not exist", i));
    return false;
}

/// With one parent each at most, whatever cannot be reached from a root is on or below a cycle.
uint64_t countReachable(std::span<const Node> nodes, const std::vector<NodeIndex>& parent) {
    std::vector<NodeIndex> stack;
    for (NodeIndex i = 0; i < nodes.size(); ++i)
        if (parent[i] == kNoNode) stack.push_back(i);
    uint64_t reached = 0;
    while (!stack.empty()) {
        const NodeIndex i = stack.back();
        stack.pop_back();
        ++reached;
        nodes[i].forEachChild([&](NodeIndex child) { stack.push_back(child); });
    }
    return reached;
}

Links findLinks(std::span<const Node> nodes) {
    Links links;
    links.parent.assign(nodes.size(), kNoNode);
    for (NodeIndex i = 0; i < nodes.size(); ++i)
        if (isRange(nodes, i, links))
            nodes[i].forEachChild([&](NodeIndex child) { linkChild(nodes, i, child, links); });
    if (links.bad > 0) return links;
    links.bad = nodes.size() - countReachable(nodes, links.parent);
    if (links.bad > 0)
        noteFault(links.fault, fmt::format("{} nodes have no root above them", links.bad));
    return links;
}

bool sameSphere(const Sphere& a, const Sphere& b) {
    return a.centre == b.centre && a.radius == b.radius;
}

bool encloses(const Sphere& outer, const Sphere& inner) {
    if (inner.radius < 0) return true;
    const double reach =
        glm::length(Vec3d(outer.centre) - Vec3d(inner.centre)) + double(inner.radius);
    return reach <= double(outer.radius) * (1 + 1e-9);
}

void checkGroups(const Forest& forest, ForestReport& report) {
    for (uint32_t g = 0; g < forest.groupCount(); ++g) {
        const Node& first = forest.node(forest.members(g).front());
        for (const NodeIndex i : forest.members(g)) {
            const Node& node = forest.node(i);
            if (node.error == first.error && node.face_size == first.face_size &&
                sameSphere(node.saturated, first.saturated) && node.isLeaf() == first.isLeaf())
                continue;
            ++report.broken_groups;
            noteFault(
                report.first_fault,
                fmt::format("node {}: differs from node {} of its group {} in error, face size, "
                            "saturated sphere or in being a leaf",
                            i, forest.members(g).front(), node.group));
            break;
        }
    }
}

void checkNode(const Forest& forest, NodeIndex i, ForestReport& report) {
    const Node& node = forest.node(i);
    // Written so that a NaN is a fault.
    if (!(node.error >= 0) || !std::isfinite(node.error)) {
        ++report.not_monotone;
        noteFault(report.first_fault, fmt::format("node {}: error {}", i, node.error));
    }
    if (!(node.face_size >= 0) || !std::isfinite(node.face_size)) {
        ++report.not_monotone;
        noteFault(report.first_fault, fmt::format("node {}: face size {}", i, node.face_size));
    }
    if (!encloses(node.saturated, node.bounds)) {
        ++report.not_nested;
        noteFault(report.first_fault,
                  fmt::format("node {}: its saturated sphere does not enclose its bounds", i));
    }
    const NodeIndex p = forest.parent(i);
    if (p == kNoNode) return;
    const Node& parent = forest.node(p);
    if (node.is_joint) {
        if (encloses(parent.saturated, node.bounds)) return;
        ++report.not_nested;
        noteFault(report.first_fault, fmt::format("node {}: a joint beyond its parent, {}", i, p));
        return;
    }
    if (!(node.error <= parent.error)) {
        ++report.not_monotone;
        noteFault(report.first_fault, fmt::format("node {}: error {} exceeds its parent's, {}", i,
                                                  node.error, parent.error));
    }
    if (!(node.face_size <= parent.face_size)) {
        ++report.not_monotone;
        noteFault(report.first_fault,
                  fmt::format("node {}: its faces are larger than its parent's", i));
    }
    if (!encloses(parent.saturated, node.saturated)) {
        ++report.not_nested;
        noteFault(report.first_fault,
                  fmt::format("node {}: its saturated sphere leaves that of its parent, {}", i, p));
    }
}

}  // namespace

ForestReport checkForest(std::span<const Node> nodes) {
    ForestReport report;
    report.nodes = nodes.size();
    const Links links = findLinks(nodes);
    report.links = links.count;
    report.bad_links = links.bad;
    report.first_fault = links.fault;
    if (links.bad > 0) return report;
    const Forest forest(nodes);
    checkGroups(forest, report);
    for (NodeIndex i = 0; i < nodes.size(); ++i) checkNode(forest, i, report);
    return report;
}

Forest::Forest(std::span<const Node> nodes) : nodes_(nodes) {
    CHECK_LT(nodes.size(), size_t(kNoNode));
    Links links = findLinks(nodes);
    if (links.bad > 0) failCheck(__FILE__, __LINE__, links.fault);
    parent_ = std::move(links.parent);
    for (NodeIndex i = 0; i < nodes.size(); ++i)
        if (parent_[i] == kNoNode) roots_.push_back(i);

    group_members_.resize(nodes.size());
    std::iota(group_members_.begin(), group_members_.end(), NodeIndex(0));
    std::sort(group_members_.begin(), group_members_.end(), [&](NodeIndex a, NodeIndex b) {
        return std::pair(nodes[a].group, a) < std::pair(nodes[b].group, b);
    });
    group_of_.resize(nodes.size());
    for (uint32_t k = 0; k < group_members_.size(); ++k) {
        if (k == 0 || nodes[group_members_[k]].group != nodes[group_members_[k - 1]].group)
            group_begin_.push_back(k);
        group_of_[group_members_[k]] = uint32_t(group_begin_.size() - 1);
    }
    group_begin_.push_back(uint32_t(nodes.size()));
}

std::vector<uint16_t> Forest::groupHeights() const {
    // Groups are taken once all groups of their children are done, so each link is seen once.
    std::vector<uint32_t> open(groupCount(), 0);
    std::vector<uint16_t> height(groupCount(), 0);
    // Joints hang below others than their group's.
    const auto counts = [&](NodeIndex i) { return parent_[i] != kNoNode && !nodes_[i].is_joint; };
    for (NodeIndex i = 0; i < nodes_.size(); ++i)
        if (counts(i)) ++open[group_of_[parent_[i]]];
    std::vector<uint32_t> ready;
    for (uint32_t g = 0; g < groupCount(); ++g)
        if (open[g] == 0) ready.push_back(g);
    while (!ready.empty()) {
        const uint32_t g = ready.back();
        ready.pop_back();
        for (const NodeIndex i : members(g)) {
            if (!counts(i)) continue;
            const uint32_t above = group_of_[parent_[i]];
            height[above] = std::max<uint16_t>(height[above], uint16_t(height[g] + 1));
            if (--open[above] == 0) ready.push_back(above);
        }
    }
    return height;
}

void Forest::closeUpward(std::vector<uint8_t>& refined) const {
    CHECK_EQ(refined.size(), size_t(groupCount()));
    std::vector<uint32_t> stack;
    for (uint32_t g = 0; g < groupCount(); ++g)
        if (refined[g]) stack.push_back(g);
    while (!stack.empty()) {
        const uint32_t g = stack.back();
        stack.pop_back();
        for (const NodeIndex i : members(g)) {
            if (parent_[i] == kNoNode || nodes_[i].is_joint || refined[group_of_[parent_[i]]])
                continue;
            refined[group_of_[parent_[i]]] = 1;
            stack.push_back(group_of_[parent_[i]]);
        }
    }
}

}  // namespace pietra
