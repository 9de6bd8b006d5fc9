#pragma once
// Packs a forest of operations into nodes (Derzapf et al. 2011, section 3.1).
//
// From the top down: a node takes the operations that its parent refers to, at most kNodeSlots,
// and then, while there is room, of those that its own refer to the one of the largest error. What
// they refer to beyond is cut in two along an axis, each side at most kNodeSlots operations with
// all that is below them, where the paper's estimate of the boxes' areas is least. Of a binary
// forest a node of kNodeSlots operations refers to at most twice as many: there is always a cut.
//
// The paper's estimate is multiplied by the number of nodes that the sides need at least, so that
// cuts that leave less empty win: nodes are 96 to 99 % full.
//
// The result is a function of the collapses. n log kNodeSlots. Memory: four bytes a vertex, and
// some hundreds a node; the slots lie in temporary space.

#include <span>
#include <vector>

#include "methods/pmesh/operation_node.h"
#include "methods/pmesh/recorder.h"

namespace pietra::pmesh {

struct PackedSlot {
    uint32_t record;
    uint32_t kinds;  ///< of both children, two bits each: none, in this node, in its child 0, in 1
};

class Packing {
public:
    explicit Packing(TempSpace& space) : slots_(space) {}

    std::vector<NodeRow> row;        ///< parent, child, operations and level
    std::vector<uint32_t> frontier;  ///< one a node
    /// One a vertex: the operation that makes it, or kNoOperation.
    std::vector<OperationId> maker;
    /// One a base vertex: its first operation, or kNoOperation.
    std::vector<OperationId> base_operation;

    std::vector<PackedSlot> slots(NodeIndex node) const;
    void append(std::span<const PackedSlot> slots);

private:
    Spill slots_;
    std::vector<uint64_t> begin_;
};

/// Sets all of `packing`, which is empty.
void packCollapses(const Collapses& collapses, Packing& packing);

}  // namespace pietra::pmesh
