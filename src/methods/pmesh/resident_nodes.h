#pragma once
// The nodes of operations that are in memory at run time (Derzapf et al. 2011, section 4.1): which
// ones are wanted, and which may leave.
//
// A frame: Adaption::frame(), note() what it missed, then arrive() for nodes that others have read,
// at most as many as the frame can bear, in the order of requests(). Never waits for anything.
//
//   - Roots are there from the beginning and stay. So does every node with an applied operation,
//     and with it those above: so coarsening needs no node that is not there.
//   - Asked for is whatever the frame marked and had not: the forced closure of what the view
//     needs, as far as it is known. What the view alone needs would not do: a vertex waits for
//     neighbours whose splits nobody asks for.
//   - Longest asked for comes first, so every node that is asked for in each frame arrives.
//   - No node arrives beyond `most`. Where more are required(), in use or asked for, than that,
//     whoever calls has to make do with less.
//   - A node that is damaged, or does not fit its parent, is never asked for again, nor what is
//     below it.
//
// Deterministic in the order of calls. Memory: bytes(), and 50 bytes a node of the file. Nodes lie
// without gaps: where one leaves, the last one takes its place. Not thread-safe.

#include <optional>
#include <span>
#include <vector>

#include "methods/pmesh/adaption.h"
#include "methods/pmesh/operation_node.h"

namespace pietra::pmesh {

/// What a node without colours and scalars takes, with what it knows of its children.
inline constexpr size_t kNodeBytes = kNodeSlots * (sizeof(Operation) + 4);

class ResidentNodes : public References {
public:
    /// Of `forest`, whose nodes but the roots may be empty. CHECKs that roots fit. setMost() goes
    /// no higher than `most`.
    ResidentNodes(NodeForest forest, uint32_t most);
    /// From now on; no node leaves for that.
    void setMost(size_t most) {
        most_ = uint32_t(std::min(most, mesh_.operation.capacity() / kNodeSlots));
    }

    /// As far as it is there. For Adaption, with this as its references.
    const ProgressiveMesh& mesh() const { return mesh_; }
    Reference referenceTo(OperationId id) const override;

    /// After each frame. Loaded nodes must not have changed since; and the mesh must not change
    /// between this and what is asked of nodes until the next frame.
    void note(const Adaption& adaption);
    /// At most so many, none loaded, in the order of need.
    std::vector<NodeIndex> requests(size_t most) const;
    /// At most so many of those that this may need, as far as their rows tell, parents first, and
    /// which fit without those used lately.
    std::vector<NodeIndex> prefetch(const Criterion& criterion, size_t most);
    /// A node without faults by itself. False, and nothing done, where it has no room or is not
    /// wanted: its parent has left, or it does not fit it.
    [[nodiscard]] bool arrive(NodeIndex index, const OperationNode& node);
    /// It is damaged.
    void giveUp(NodeIndex index) { state_[index].is_bad = true; }
    bool isGivenUp(NodeIndex index) const { return state_[index].is_bad; }
    /// False, and nothing done, if it must stay.
    [[nodiscard]] bool evict(NodeIndex index);
    /// Of those that may leave, that which was not used for longest; false if there is none.
    bool evictOldest();

    bool isLoaded(NodeIndex n) const {
        return mesh_.place_of_node[n] != ProgressiveMesh::kNotLoaded;
    }
    size_t loaded() const { return node_at_.size(); }
    size_t required();                                ///< in use or asked for, by the last frame
    size_t missing() const { return asked_.size(); }  ///< asked for by the last frame

    /// What one node takes of this model.
    size_t nodeBytes() const { return kNodeBytes + kNodeSlots * wordsOfOne() * sizeof(uint32_t); }
    /// What nodes take, those included that have left since the last giveBack().
    size_t bytes() const { return most_at_a_time_ * nodeBytes(); }
    /// Gives the memory of those that have left to the system.
    void giveBack();

private:
    struct State {
        uint32_t asked = 0;      ///< frames in a row
        uint32_t last_used = 0;  ///< the frame
        uint8_t loaded_children = 0;
        bool is_pinned = false;  ///< must stay
        bool is_bad = false;
    };
    static constexpr uint32_t kFramesKept = 60;  ///< for what is only prefetched

    size_t wordsOfOne() const { return 2 * size_t(mesh_.layout.words()); }
    void pin();
    bool makeRoom();
    bool mayLeave(NodeIndex n) const {
        const State& s = state_[n];
        return isLoaded(n) && !s.is_pinned && s.last_used != frame_;
    }

    ProgressiveMesh mesh_;
    std::vector<NodeRow> row_;
    std::vector<State> state_;
    std::vector<std::array<std::vector<uint16_t>, 2>> reference_level_;  // a place
    std::vector<NodeIndex> node_at_;                                     ///< the same
    std::vector<NodeIndex> asked_;
    std::optional<std::vector<NodeIndex>> victims_;  // of this frame, the last one first
    uint32_t most_;
    uint32_t frame_ = 0;
    const ActiveMesh* unpinned_ = nullptr;  ///< the frame's, whose nodes are not pinned yet
    size_t most_at_a_time_ = 0;
};

}  // namespace pietra::pmesh
