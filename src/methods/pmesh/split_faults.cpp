#include "methods/pmesh/split_faults.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace pietra::pmesh {
namespace {

constexpr int32_t kFarthest = 1 << 22;  ///< more than any lattice is wide

/// As far as it can be told without places.
bool mayEnclose(const LocalCriterion& outer, const LocalCriterion& inner) {
    return outer.error >= inner.error && outer.scale >= inner.scale &&
           outer.normals.encloses(inner.normals);
}

/// Checks the slots in their order; what each refers to must be the next that is not yet.
class NodeChecker {
public:
    NodeChecker(const SplitRow& row, const SplitNode& node)
        : row_(row), node_(node), next_{node.frontier, 0, 0} {}

    std::string fault() {
        const size_t size = node_.split.size();
        if (size != row_.splits || size > kSplitSlots || node_.frontier > size)
            return fmt::format("it has {} splits", size);
        for (size_t s = 0; s < size; ++s)
            if (const std::string f = splitFault(node_.split[s], s); !f.empty())
                return fmt::format("split {}: {}", s, f);
        if (next_[0] != size) return "not all splits are referred to";
        for (const size_t side : {0u, 1u}) {
            if ((next_[1 + side] == 0) != (row_.child[side] == kNoNode))
                return fmt::format("it refers to {} splits of child {}", next_[1 + side], side);
            if ((row_.child[side] == kNoNode) != node_.child_parts[side].empty() ||
                node_.child_parts[side].size() > kMostParts)
                return fmt::format("child {} has {} parts", side, node_.child_parts[side].size());
            for (const NestedCriterion& part : node_.child_parts[side])
                if (!row_.criterion.encloses(part))
                    return fmt::format("child {}'s criterion exceeds its own", side);
        }
        return "";
    }

private:
    std::string splitFault(const VertexSplit& split, size_t slot) {
        const LocalCriterion& c = split.criterion;
        if (c.error == 0 || c.error >= NestedCriterion::kEver) return "its error is no number";
        if (c.scale > LocalCriterion::kMostScale) return "its box is none of this grid";
        if (c.error > row_.criterion.error) return "its error exceeds its node's";
        if (uint64_t(split.leaves[0]) + split.leaves[1] >= 1u << 31)
            return "it has too many leaves";
        for (const uint32_t side : {0u, 1u}) {
            if ((split.brings >> side & 1) == 0) continue;
            const VertexSplit::Corners& corner = split.corner[side];
            if (corner.v >= split.leaves[0] || corner.u >= split.leaves[1] ||
                (corner.w >= -int64_t(split.leaves[0]) && corner.w < int64_t(split.leaves[1])))
                return "a corner is not where it should be";
        }
        for (const Vec3i& d : split.offset)
            if (glm::any(glm::greaterThan(glm::abs(d), Vec3i(kFarthest)))) return "it goes too far";
        for (const size_t end : {0u, 1u})
            if (std::string f = childFault(split, end, slot); !f.empty()) return f;
        return "";
    }

    std::string childFault(const VertexSplit& split, size_t end, size_t slot) {
        const uint16_t code = split.child[end];
        if (code == kNoChildSplit) return split.leaves[end] == 1 ? "" : "an end has several leaves";
        if (split.leaves[end] < 2) return "an end that splits has one leaf";
        if (code >= 3 * kSplitSlots) return "its child is nowhere";
        const size_t where = code / kSplitSlots, at = code % kSplitSlots;
        if (at != next_[where]++) return "its children are not the next ones";
        if (where > 0) return "";
        if (at >= node_.split.size() || at <= slot) return "its child is not there";
        const VertexSplit& child = node_.split[at];
        if (uint64_t(child.leaves[0]) + child.leaves[1] != split.leaves[end])
            return "its leaves are not its child's";
        if (!mayEnclose(split.criterion, child.criterion))
            return "its child's criterion exceeds its own";
        return "";
    }

    const SplitRow& row_;
    const SplitNode& node_;
    std::array<size_t, 3> next_;  // slots that nothing refers to yet: own, of the children
};

}  // namespace

std::string faultOf(const SplitRow& row, const SplitNode& node) {
    return NodeChecker(row, node).fault();
}

std::string faultBetween(const SplitRow& parent_row, const SplitNode& parent, NodeIndex child,
                         const SplitNode& node) {
    const uint32_t side = parent_row.child[0] == child ? 0 : 1;
    uint32_t count = 0;
    for (const VertexSplit& split : parent.split)
        for (const size_t end : {0u, 1u}) {
            if (split.child[end] == kNoChildSplit || split.child[end] / kSplitSlots != 1 + side)
                continue;
            const uint32_t slot = split.child[end] % kSplitSlots;
            ++count;
            if (slot >= node.frontier) continue;
            const VertexSplit& below = node.split[slot];
            if (uint64_t(below.leaves[0]) + below.leaves[1] != split.leaves[end])
                return fmt::format("split {}: its leaves are not what its parent knows", slot);
            if (!mayEnclose(split.criterion, below.criterion))
                return fmt::format("split {}: its criterion exceeds its parent's", slot);
        }
    if (count != node.frontier)
        return fmt::format("{} splits are referred to, not {}", count, node.frontier);
    return "";
}

Node tableNode(NodeIndex index, const SplitRow& row, const SplitNode& node, const Lattice& lattice,
               const SplitGrid& grid, std::span<const Sphere> below) {
    const double unit = grid.unit(lattice);
    Node n;
    Vec3d low, high;
    for (int k = 0; k < 3; ++k) {
        low[k] = double(row.criterion.min[size_t(k)]);
        high[k] = double(row.criterion.max[size_t(k)]);
    }
    const Vec3d origin = Vec3d(grid.origin) * double(uint64_t(1) << lattice.shift);
    const Vec3f centre(origin + 0.5 * unit * (low + high));
    // Enough that rounding back comes to no less.
    double radius = 0.5 * unit * glm::length(high - low) * (1 + 1e-6) + 0.01 * unit + 2;
    for (const Sphere& s : below)
        radius =
            std::max(radius, (glm::distance(Vec3d(s.centre), Vec3d(centre)) + double(s.radius)) *
                                 (1 + 1e-6));
    n.saturated = n.bounds = {centre, float(radius)};
    n.error = float(double(NestedCriterion::errorOf(row.criterion.error)) * unit);
    n.child[0] = row.child[0];
    n.child[1] = row.child[1];
    n.group = index;
    n.level = row.level;
    n.vertices = uint32_t(node.split.size());
    for (const VertexSplit& split : node.split)
        n.triangles += (split.brings & 1u) + (split.brings >> 1 & 1u);
    return n;
}

std::vector<SplitRow> rowsOf(std::span<const Node> table) {
    std::vector<SplitRow> rows(table.size());
    for (NodeIndex i = 0; i < table.size(); ++i) {
        const Node& n = table[i];
        rows[i].child = {n.child[0], n.child[1]};
        for (const NodeIndex c : rows[i].child)
            if (c != kNoNode) rows[c].parent = i;
        rows[i].splits = n.vertices;
        rows[i].level = n.level;
    }
    return rows;
}

void setCriteria(std::span<const Node> table, const Lattice& lattice, const SplitGrid& grid,
                 std::vector<SplitRow>& rows) {
    const double unit = grid.unit(lattice);
    const Vec3d origin = Vec3d(grid.origin) * double(uint64_t(1) << lattice.shift);
    // Of a file of unknown origin: anything may stand there.
    const auto clamped = [](double x) { return uint16_t(x > 0 ? std::min(x, 65535.0) : 0); };
    for (NodeIndex i = 0; i < table.size(); ++i) {
        const Node& n = table[i];
        NestedCriterion& c = rows[i].criterion;
        for (int k = 0; k < 3; ++k) {
            const double centre = (double(n.saturated.centre[k]) - origin[k]) / unit;
            const double radius = double(n.saturated.radius) / unit;
            c.min[size_t(k)] = clamped(std::floor(centre - radius));
            c.max[size_t(k)] = clamped(std::ceil(centre + radius));
        }
        const double error = double(n.error) / unit;
        c.error = error > 0 && error < 1e30 ? NestedCriterion::errorUp(float(error)) : uint16_t(0);
        c.normals = NormalBox();
    }
}

}  // namespace pietra::pmesh
