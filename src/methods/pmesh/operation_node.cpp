#include "methods/pmesh/operation_node.h"

#include <fmt/format.h>

#include <algorithm>

namespace pietra::pmesh {
Operation toOperation(NodeIndex node, const NodeRow& row, const NodeOperation& n) {
    Operation o;
    o.child = {childId(node, row, n, 0), childId(node, row, n, 1)};
    o.level = uint16_t(n.structure.level());
    o.radius = n.radius;
    o.error = n.error;
    o.ranks = n.ranks;
    o.shift = n.shift;
    o.delta = n.delta;
    o.normals = n.normals;
    o.normal = n.normal;
    return o;
}

Node tableNode(NodeIndex index, const NodeRow& row, const OperationNode& node, int lattice_shift) {
    const auto step = float(1 << lattice_shift);
    Node n;
    n.saturated = {Vec3f(row.centre) * step, float(decodeRadius(row.radius)) * step};
    n.bounds = n.saturated;
    n.error = float(decodeError(row.error)) * float(kErrorUnit) * step;
    n.child[0] = row.child[0];
    n.child[1] = row.child[1];
    n.group = index;
    n.level = row.level;
    n.vertices = uint32_t(node.operation.size());
    for (const NodeOperation& o : node.operation)
        n.triangles += ((o.ranks & 15u) != kNoRank) + ((o.ranks >> 4) != kNoRank);
    return n;
}

std::vector<NodeRow> rowsOf(std::span<const Node> table, int lattice_shift) {
    const float step = float(1 << lattice_shift), most = 1 << 23;
    // Of a file of unknown origin: anything may stand there.
    const auto whole = [&](float x, float scale) {
        const float y = x / (step * scale);
        return y >= -most && y <= most ? int32_t(y) : 0;
    };
    std::vector<NodeRow> rows(table.size());
    for (NodeIndex i = 0; i < table.size(); ++i) {
        const Node& n = table[i];
        NodeRow& row = rows[i];
        row.child = {n.child[0], n.child[1]};
        for (const NodeIndex c : row.child)
            if (c != kNoNode) rows[c].parent = i;
        row.operations = n.vertices;
        row.level = n.level;
        const Vec3f& c = n.saturated.centre;
        row.centre = {whole(c.x, 1), whole(c.y, 1), whole(c.z, 1)};
        row.radius =
            uint16_t(encodeRoundedUp<11>(uint64_t(std::max(whole(n.saturated.radius, 1), 0))));
        const double units = double(n.error) / (double(step) * kErrorUnit);
        row.error = units >= double(decodeError(kMaxErrorCode))
                        ? uint8_t(kMaxErrorCode)
                        : uint8_t(encodeRoundedUp<3>(units > 0 ? uint64_t(units) : 0));
    }
    return rows;
}

ProgressiveMesh fromNodes(const NodeForest& forest) {
    ProgressiveMesh mesh{forest.lattice,
                         forest.base_vertex,
                         forest.base_triangle,
                         forest.base_closed,
                         forest.base_operation,
                         {},
                         {}};
    mesh.layout = forest.layout;
    mesh.base_word = forest.base_word;
    if (forest.node.empty()) return mesh;
    Operation none{};
    none.child = {kNoOperation, kNoOperation};
    mesh.operation.assign(operationId(NodeIndex(forest.node.size() - 1),
                                      uint32_t(forest.node.back().operation.size())),
                          none);
    const size_t words = 2 * size_t(forest.layout.words());
    mesh.word.resize(mesh.operation.size() * words);
    for (NodeIndex n = 0; n < forest.node.size(); ++n) {
        for (uint32_t s = 0; s < forest.node[n].operation.size(); ++s)
            mesh.operation[operationId(n, s)] =
                toOperation(n, forest.row[n], forest.node[n].operation[s]);
        std::ranges::copy(forest.node[n].word,
                          mesh.word.begin() + ptrdiff_t(words * operationId(n, 0)));
    }
    return mesh;
}

namespace {

/// Checks the slots in their order; what each refers to must be the next that is not yet.
class NodeChecker {
public:
    NodeChecker(NodeIndex index, const NodeRow& row, const OperationNode& node)
        : index_(index), row_(row), node_(node), next_{node.frontier, 0, 0} {}

    std::string fault() {
        const size_t size = node_.operation.size();
        if (size != row_.operations || size > kNodeSlots || node_.frontier > size)
            return fmt::format("it has {} operations", size);
        for (slot_ = 0; slot_ < size; ++slot_)
            if (const std::string f = operationFault(); !f.empty())
                return fmt::format("operation {}: {}", slot_, f);
        for (const size_t side : {0u, 1u}) {
            const size_t levels = node_.reference_level[side].size();
            if (next_[1 + side] != levels || (levels == 0) != (row_.child[side] == kNoNode))
                return fmt::format("it refers to {} operations of child {}, and has {} levels",
                                   next_[1 + side], side, levels);
        }
        if (next_[0] != size) return "not all operations are referred to";
        return "";
    }

private:
    std::string operationFault() {
        const NodeOperation& n = node_.operation[slot_];
        const Operation o = toOperation(index_, row_, n);
        if (o.error == 0) return "its error has the code 0";
        if (o.error > row_.error) return "its error exceeds its node's";
        if (std::string f = pmesh::faultOf(o); !f.empty()) return f;
        for (const int end : {0, 1}) {
            if (end == 1 && o.isDummy()) return beforeFault(n.structure.child(1));
            if (std::string f = childFault(o, n.structure.child(end), end); !f.empty()) return f;
        }
        return "";
    }

    std::string childFault(const Operation& o, ChildCode code, int end) {
        if (isNoChild(code)) return "";
        const size_t where = code / kNodeSlots, slot = code % kNodeSlots;
        if (slot != next_[where]++) return "its children are not the next ones";
        if (where > 0) {
            const auto& levels = node_.reference_level[where - 1];
            if (slot >= levels.size()) return "its child has no level";
            if (levels[slot] <= o.level || levels[slot] > kMaxLevel)
                return "its level is not below its child's";
            return "";
        }
        if (slot >= node_.operation.size()) return "its child is not there";
        const NodeOperation& c = node_.operation[slot];
        if (c.structure.level() <= o.level) return "its level is not below its child's";
        if (!criteriaNest(o, toOperation(index_, row_, c), end))
            return "its child's criteria exceed its own";
        if (c.isDummy() && c.structure.child(1) != slot_) return "its child does not know it";
        return "";
    }

    /// In the own node, childFault() of the one before has looked at it.
    std::string beforeFault(ChildCode code) const {
        const bool from_above = slot_ < node_.frontier;
        const bool fits = !from_above              ? code < slot_
                          : row_.parent == kNoNode ? isNoChild(code)
                                                   : code / kNodeSlots == 1;
        return fits ? "" : "it does not know its parent";
    }

    NodeIndex index_;
    const NodeRow& row_;
    const OperationNode& node_;
    std::array<size_t, 3> next_;  // slots that nothing refers to yet: own, of the children
    size_t slot_ = 0;
};

}  // namespace

std::string faultOf(NodeIndex index, const NodeRow& row, const OperationNode& node) {
    return NodeChecker(index, row, node).fault();
}

std::string faultBetween(const NodeRow& parent_row, const OperationNode& parent, NodeIndex child,
                         const OperationNode& node) {
    const size_t side = parent_row.child[0] == child ? 0 : 1;
    const auto& levels = parent.reference_level[side];
    if (levels.size() != node.frontier)
        return fmt::format("{} operations are referred to, not {}", levels.size(), node.frontier);
    for (uint32_t s = 0; s < parent.operation.size(); ++s) {
        const NodeOperation& o = parent.operation[s];
        for (const int end : {0, 1}) {
            const ChildCode code = o.structure.child(end);
            if ((end == 1 && o.isDummy()) || code / kNodeSlots != 1 + side) continue;
            const uint32_t slot = code % kNodeSlots;
            const NodeOperation& c = node.operation[slot];
            if (c.structure.level() != levels[slot])
                return fmt::format("operation {}: its level is not the one its parent knows", slot);
            if (c.isDummy() && c.structure.child(1) != kNodeSlots + s)
                return fmt::format("operation {}: it does not know its parent", slot);
            if (!criteriaNest(toOperation(0, parent_row, o), toOperation(0, parent_row, c), end))
                return fmt::format("operation {}: its criteria exceed its parent's", slot);
        }
    }
    return "";
}

}  // namespace pietra::pmesh
