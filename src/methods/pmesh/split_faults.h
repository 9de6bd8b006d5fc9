#pragma once
// What may be wrong with splits of unknown origin, and nodes in a file's table. Pure functions,
// thread-safe; never throw.

#include <span>
#include <string>

#include "methods/pmesh/split_node.h"

namespace pietra::pmesh {

/// The first fault in a sentence, or empty. Of a node by itself and its row (whose own indices are
/// known to be good): counts, the order of slots, leaves, ranges, errors and normals; whether boxes
/// nest depends on where the node is.
[[nodiscard]] std::string faultOf(const SplitRow& row, const SplitNode& node);
/// Of a node and its parent, each without fault: that they agree on what lies between them.
[[nodiscard]] std::string faultBetween(const SplitRow& parent_row, const SplitNode& parent,
                                       NodeIndex child, const SplitNode& node);

/// As a file's table of nodes has it: Node::vertices counts splits, Node::triangles what they
/// bring. `below`: the spheres of its children, which its own encloses.
Node tableNode(NodeIndex index, const SplitRow& row, const SplitNode& node, const Lattice& lattice,
               const SplitGrid& grid, std::span<const Sphere> below);
/// And back: criteria that enclose those. Indices must be good.
std::vector<SplitRow> rowsOf(std::span<const Node> table);
void setCriteria(std::span<const Node> table, const Lattice& lattice, const SplitGrid& grid,
                 std::vector<SplitRow>& rows);

}  // namespace pietra::pmesh
