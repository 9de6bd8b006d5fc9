#pragma once
// Packs a forest of operations into nodes (Derzapf et al. 2011, section 3.1).
//
// From the top down: a node takes the operations that its parent refers to, at most kSplitSlots,
// and then, while there is room, of those that its own refer to the one of the largest error. What
// they refer to beyond is cut in two along an axis, each side at most kSplitSlots operations with
// all that is below them, where the paper's estimate of the boxes' areas is least. Of a binary
// forest a node of kSplitSlots operations refers to at most twice as many: there is always a cut.
//
// The paper's estimate is multiplied by the number of nodes that the sides need at least, so that
// cuts that leave less empty win: nodes are 96 to 99 % full.
//
// The result is a function of the collapses. n log kSplitSlots. Memory: O(base mesh); nodes, those
// that wait with what is referred to in them, too, lie in temporary space.

#include <functional>
#include <span>
#include <vector>

#include "methods/pmesh/collapses.h"

namespace pietra::pmesh {

struct PackedSlot {
    uint32_t record;
    Leaf first;      ///< of the range that it parts
    uint32_t kinds;  ///< of both children, two bits each: none, in this node, in its child 0, in 1
};

struct PackedNode {
    SplitRow row;  ///< parent, child, operations and level
    uint32_t frontier = 0;
    std::vector<PackedSlot> slot;
};

class Packing {
public:
    explicit Packing(TempSpace& space) : nodes_(space) {}

    /// One a base vertex: its first split, or kNoSplit, and how many leaves are below it.
    std::vector<SplitId> base_split;
    std::vector<uint32_t> base_leaves;

    NodeIndex size() const { return size_; }
    PackedNode node(NodeIndex n) const;
    /// At the end, or in the place of another.
    void put(NodeIndex n, const PackedNode& node);

private:
    struct Head {
        SplitRow row;
        uint32_t frontier, slots;
    };
    static constexpr uint64_t kBytes = sizeof(Head) + kSplitSlots * sizeof(PackedSlot);
    Spill nodes_;
    NodeIndex size_ = 0;
};

/// Told the first leaf of each vertex, once.
using LeafSink = std::function<void(VertexId, Leaf)>;

/// Sets all of `packing`, which is empty.
void packCollapses(const Collapses& collapses, Packing& packing, const LeafSink& leaves);

}  // namespace pietra::pmesh
