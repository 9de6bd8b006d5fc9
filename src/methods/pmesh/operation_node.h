#pragma once
// Nodes: operations as they lie on disk and come and go at run time (Derzapf et al. 2011, sections
// 3.1 and 3.2).
//
// Nodes form binary trees. The operation in slot s of node n has the id n * kNodeSlots + s, and so
// its name is base vertex count + that (operations.h); ids of slots that a node does not have are
// unused. An operation's children lie in its own node or in one of its node's two children, and are
// told by codes of 11 bits; a level has the other 10 bits of a word.
//
// What is resident whether a node is loaded or not: its row (NodeRow), which encloses all
// operations in it and below. What a node knows of its children: the levels of the operations that
// it refers to. So a vertex whose next split is not loaded still orders its neighbours' splits.
//
// Slots: first those that the parent node (or, of a root, the base mesh) refers to, then the others
// in the order in which the slots before refer to them; so parents lie before children, and the
// slots that a node refers to in a child count from 0 without gaps, in the order of reference.
//
// Plain data.

#include <array>
#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "geometry/bounds.h"
#include "methods/pmesh/operations.h"
#include "multires/node.h"

namespace pietra::pmesh {

constexpr OperationId operationId(NodeIndex node, uint32_t slot) {
    return node * kNodeSlots + slot;
}
constexpr NodeIndex nodeOf(OperationId id) {
    return id / kNodeSlots;
}
constexpr uint32_t slotIn(OperationId id) {
    return id % kNodeSlots;
}

/// 0 to 681: a slot of the own node; 682 to 1363 and 1364 to 2045: of child 0 and child 1; 2046 and
/// 2047: none. Where a dummy, which has no u, would have u's next split, it has the operation that
/// its vertex came from: a slot of the own node, or 682 and more: of the parent node.
using ChildCode = uint32_t;
inline constexpr ChildCode kNoChildCode = 2047;
constexpr bool isNoChild(ChildCode code) {
    return code >= 3 * kNodeSlots;
}

/// Two child codes and a level.
struct StructureWord {
    uint32_t bits = 0;
    static constexpr StructureWord of(ChildCode v, ChildCode u, uint32_t level) {
        return {v | u << 11 | level << 22};
    }
    constexpr ChildCode child(int end) const { return bits >> (end == 0 ? 0 : 11) & 2047u; }
    constexpr uint32_t level() const { return bits >> 22; }
    bool operator==(const StructureWord&) const = default;
};

/// An operation in its node. Fields as in Operation.
struct NodeOperation {
    StructureWord structure;
    uint16_t radius = 0;
    uint8_t error = 0;
    uint8_t ranks = 0;
    std::array<std::array<int8_t, 3>, 2> delta{};
    std::array<uint16_t, 2> normal{};
    uint8_t shift = 0;
    NormalBox normals;
    std::array<uint8_t, 2> unused{};
    bool isDummy() const { return ranks == Operation::kDummyRanks; }
    bool operator==(const NodeOperation&) const = default;
};
static_assert(sizeof(NodeOperation) == 24);

/// A node as its page is decoded.
struct OperationNode {
    std::vector<NodeOperation> operation;  ///< at most kNodeSlots
    /// How many operations, the first ones, are referred to from above.
    uint32_t frontier = 0;
    /// Of the operations referred to in each child node, in the order of their slots.
    std::array<std::vector<uint16_t>, 2> reference_level;
    WordLayout layout;
    std::vector<uint32_t> word;  ///< for each operation those of v, then of u
    bool operator==(const OperationNode&) const = default;
};

/// What is known of a node without its page. Integers in steps, exactly as the file keeps them.
struct NodeRow {
    NodeIndex parent = kNoNode;
    std::array<NodeIndex, 2> child{kNoNode, kNoNode};
    uint32_t operations = 0;
    uint16_t level = 0;     ///< in the tree of nodes: 0 for roots; not that of an operation
    uint16_t radius = 0;    ///< a code, like an operation's: of the sphere around `centre`
    uint8_t error = 0;      ///< the largest code in it and below
    Vec3i centre{0, 0, 0};  ///< the sphere encloses those of all operations in it and below
    bool operator==(const NodeRow&) const = default;
};

/// The operation of a code, kNoOperation for none; `row` is that of `node`. For end 1 of a dummy
/// see ChildCode: this gives the operation before then.
inline OperationId childId(NodeIndex node, const NodeRow& row, const NodeOperation& o, int end) {
    const ChildCode code = o.structure.child(end);
    if (isNoChild(code)) return kNoOperation;
    if (code < kNodeSlots) return operationId(node, code);
    if (end == 1 && o.isDummy()) return operationId(row.parent, code - kNodeSlots);
    return operationId(row.child[code / kNodeSlots - 1], code % kNodeSlots);
}

/// With its children's ids.
Operation toOperation(NodeIndex node, const NodeRow& row, const NodeOperation& o);

/// A progressive mesh as nodes: what a file holds.
struct NodeForest {
    Lattice lattice;
    std::vector<Vertex> base_vertex;
    std::vector<Triangle> base_triangle;
    std::vector<uint8_t> base_closed;         ///< as in ProgressiveMesh
    std::vector<OperationId> base_operation;  ///< in slots of roots, or none
    WordLayout layout;
    std::vector<uint32_t> base_word;
    std::vector<NodeRow> row;  ///< level by level: parents before children
    std::vector<OperationNode> node;
};

/// As a file's table of nodes has it, and back; both lose nothing but the bounds, which there are
/// the sphere. Node::vertices counts operations, Node::triangles what they add to the mesh.
Node tableNode(NodeIndex index, const NodeRow& row, const OperationNode& node, int lattice_shift);
std::vector<NodeRow> rowsOf(std::span<const Node> table, int lattice_shift);

/// As one forest, in memory. All nodes must be there, and without fault.
ProgressiveMesh fromNodes(const NodeForest& forest);

/// Both take nodes of unknown origin and say the first fault in a sentence, empty if there is none;
/// never throw. Of a node by itself and its row (whose own indices are known to be good): counts,
/// the order of slots, levels, ranges and criteria.
[[nodiscard]] std::string faultOf(NodeIndex index, const NodeRow& row, const OperationNode& node);
/// Of a node and its parent, each without fault: that they agree on what lies between them.
[[nodiscard]] std::string faultBetween(const NodeRow& parent_row, const OperationNode& parent,
                                       NodeIndex child, const OperationNode& node);

}  // namespace pietra::pmesh
