#pragma once
// The nodes of splits that are in memory at run time (Derzapf et al. 2011, section 4.1): which ones
// are wanted, and which may leave.
//
// A frame: look() at the view, then whoever adapts asks for splits; then arrive() for nodes that
// others have read, in the order of requests(). Never waits for anything.
//
//   - Roots are there from the beginning and stay.
//   - Wanted is a node of which the view needs a part of what its parent says that its frontier
//     states, which encloses all that is in it and below. Asked for is what is wanted and not
//     there, while its parent is. Longest asked for comes first.
//   - While some are missing, a split may depend on what nobody can know: it is blocked if its
//     criterion lies within such a part of a missing node. What is not blocked depends on nothing
//     that is missing or blocked, as criteria nest along dependencies. What was applied before may
//     stay.
//   - What is wanted is in use and stays; undoing a split needs no node.
//   - No node arrives beyond `most`. Where more are required(), in use or asked for, than that,
//     whoever calls has to make do with less.
//   - A node that is damaged, or does not fit its parent, is never asked for again, nor what is
//     below it; it blocks for ever.
//
// Deterministic in the order of calls. Memory: bytes(), and some 60 bytes a node of the file. Nodes
// lie without gaps: where one leaves, the last one takes its place. Not thread-safe, but for at(),
// isLoaded() and isBlocked().

#include <memory>
#include <optional>
#include <span>
#include <vector>

#include "methods/pmesh/split_view.h"

namespace pietra::pmesh {

/// All of a split that adaption needs, in a line and a half of a cache.
struct alignas(32) ResidentSplit {
    Leaf name;
    std::array<uint16_t, 2> child;  ///< as in VertexSplit, but that child[0] may have kClosed, too
    std::array<Leaf, 6> corner;     ///< of the triangles it brings; three equal: none
    std::array<Vec3i, 2> position;  ///< of v and u after it
    std::array<uint16_t, 2> normal;
    std::array<NestedCriterion, 2> criterion;     ///< of the children, or of the row of their node
    static constexpr uint16_t kClosed = 1 << 15;  ///< its triangles' component is

    SplitVertex vertex(size_t end) const { return {position[end], normal[end]}; }
    bool closed() const { return (child[0] & kClosed) != 0; }
};
static_assert(sizeof(ResidentSplit) == 96);

class ResidentSplits {
public:
    /// Of `forest`, whose nodes but the roots may be empty. CHECKs that roots fit. setMost() goes
    /// no higher than `most`.
    ResidentSplits(SplitForest forest, uint32_t most);
    /// From now on; no node leaves for that.
    void setMost(size_t most) { most_ = uint32_t(std::min<size_t>(most, limit_)); }

    const SplitForest& forest() const { return forest_; }  ///< without its nodes
    uint32_t leaves() const { return leaves_; }
    bool isLoaded(NodeIndex n) const { return split_[n] != nullptr; }
    /// Its node must be loaded.
    const ResidentSplit& at(SplitId id) const { return split_[nodeOfSplit(id)][slotOfSplit(id)]; }
    /// The next splits of v and u after `split`, which is at(id), or kNoSplit.
    std::array<SplitId, 2> childrenOf(SplitId id, const ResidentSplit& split) const {
        const NodeIndex node = nodeOfSplit(id);
        const auto of = [&](uint32_t code) {
            if (code < kSplitSlots) return splitId(node, code);
            if (code == kNoChildSplit) return kNoSplit;
            const uint32_t side = code / kSplitSlots - 1;
            return splitId(forest_.row[node].child[side], code % kSplitSlots);
        };
        return {of(split.child[0] & uint16_t(~ResidentSplit::kClosed)), of(split.child[1])};
    }
    /// Of a root's first split.
    const NestedCriterion& rootCriterion(SplitId id) const { return root_criterion_[id]; }
    /// Of v, then of u, after it.
    const uint32_t* wordsOf(SplitId id) const {
        return node_[nodeOfSplit(id)]->word.data() + slotOfSplit(id) * wordsOfOne();
    }

    /// What the view wants.
    void look(const SplitView& view);
    bool anyBlocks() const { return !blocking_.error.empty(); }
    bool isBlocked(const NestedCriterion& c) const;
    /// What isBlocked() looks through; normals mean nothing.
    std::vector<NestedCriterion> blocking() const;
    /// At most so many, none loaded, in the order of need.
    std::vector<NodeIndex> requests(size_t most) const;
    /// At most so many of those that this view wants, parents first, and which fit without those
    /// used lately.
    std::vector<NodeIndex> prefetch(const SplitView& view, size_t most);

    /// A vertex whose next split has arrived: its first leaf, the split, and what it states.
    struct Arrived {
        Leaf first;
        SplitId split;
        NestedCriterion criterion;
    };
    /// A node without faults by itself. Nothing, and nothing done, where it has no room or its
    /// parent has left; isGivenUp() where it does not fit that.
    [[nodiscard]] std::optional<std::vector<Arrived>> arrive(NodeIndex index,
                                                             const SplitNode& node);
    /// It is damaged.
    void giveUp(NodeIndex index) { state_[index].is_bad = true; }
    bool isGivenUp(NodeIndex index) const { return state_[index].is_bad; }
    /// Of those that may leave, that which was not used for longest; false if there is none.
    bool evictOldest();

    size_t loaded() const { return loaded_.size(); }
    std::span<const NodeIndex> loadedNodes() const { return loaded_; }  ///< in no order
    size_t required() const { return wanted_ + asked_.size(); }         ///< by the last look()
    size_t missing() const { return asked_.size(); }                    ///< likewise, asked for

    /// What one node takes of this model.
    size_t nodeBytes() const {
        return kSplitSlots * (sizeof(ResidentSplit) + wordsOfOne() * sizeof(uint32_t)) +
               kSplitSlots * sizeof(Reference);
    }
    size_t bytes() const { return loaded_.size() * nodeBytes(); }

private:
    struct State {
        uint32_t asked = 0;      ///< frames in a row
        uint32_t last_used = 0;  ///< the frame
        uint8_t loaded_children = 0;
        bool is_bad = false;
    };
    /// To a split in a child node, in the order of its slots.
    struct Reference {
        Leaf first;
        uint32_t leaves;
        uint16_t slot;
        uint16_t end;
    };
    /// Columns, as many are looked through for each split.
    struct Blocking {
        std::array<std::vector<uint16_t>, 3> min, max;
        std::vector<uint16_t> error;
        void clear();
        void add(const NestedCriterion& c);
    };
    struct Loaded {
        std::unique_ptr<ResidentSplit[]> split;
        std::vector<uint32_t> word;
        std::array<std::vector<Reference>, 2> reference;
        std::array<std::vector<NestedCriterion>, 2> child_parts;
        uint32_t position;  ///< in loaded_
    };
    static constexpr uint32_t kFramesKept = 60;  ///< for what is only prefetched

    size_t wordsOfOne() const { return 2 * size_t(forest_.layout.words()); }
    void keep(NodeIndex index, std::unique_ptr<Loaded> loaded);
    std::unique_ptr<Loaded> placed(NodeIndex index, const SplitNode& node,
                                   std::span<const Reference> above,
                                   std::span<const SplitVertex> before) const;
    bool makeRoom();
    void evict(NodeIndex index);
    bool mayLeave(NodeIndex n) const {
        const State& s = state_[n];
        return isLoaded(n) && forest_.row[n].parent != kNoNode && s.loaded_children == 0 &&
               s.last_used != frame_;
    }

    SplitForest forest_;
    uint32_t leaves_ = 0;
    std::vector<State> state_;
    std::vector<std::unique_ptr<Loaded>> node_;
    std::vector<const ResidentSplit*> split_;      ///< of each node; null: not loaded
    std::vector<NestedCriterion> root_criterion_;  ///< by id; root nodes come first
    std::vector<NodeIndex> loaded_;  ///< in the order of their arrival, but for gaps filled
    std::vector<NodeIndex> asked_;
    std::optional<std::vector<NodeIndex>> victims_;  // of this frame, the last one first
    Blocking blocking_;
    uint32_t most_, limit_;
    uint32_t frame_ = 1;
    size_t wanted_ = 0;  ///< and loaded
};

}  // namespace pietra::pmesh
