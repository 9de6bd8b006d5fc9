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
// The result is a function of the arguments. n log kNodeSlots; 16 bytes an operation.

#include <span>
#include <vector>

#include "methods/pmesh/operation_node.h"

namespace pietra::pmesh {

struct PackOperation {
    std::array<uint32_t, 2> child;  ///< indices, or kNoOperation
    float error;                    ///< need not be saturated
    Box3i box;                      ///< of what the operation itself touches
};

struct Packing {
    std::vector<NodeRow> row;        ///< parent, child, operations and level
    std::vector<OperationId> id_of;  ///< one an operation
};

/// `roots`: those without a parent. Parents lie before their children. Changes errors and boxes to
/// those of all that is below an operation.
Packing packOperations(std::span<PackOperation> operations, std::span<const uint32_t> roots);

}  // namespace pietra::pmesh
