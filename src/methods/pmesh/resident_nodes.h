#pragma once
// The nodes of operations that are in memory at run time (Derzapf et al. 2011, section 4.1): which
// ones are wanted, which may leave, and how much coarser everything must be so that they fit.
//
// A frame: Adaption::frame(), note() what it missed, then arrive() for nodes that others have read,
// at most as many as the frame can bear, in the order of requests(). Never waits for anything.
//
//   - Roots are there from the beginning and stay. So does every node with an applied operation,
//     and with it those above: so coarsening needs no node that is not there.
//   - Asked for is whatever the frame marked and had not: the forced closure of what the view
//   needs,
//     as far as it is known. What the view alone needs would not do: a vertex waits for neighbours
//     whose splits nobody asks for.
//   - Longest asked for comes first, so every node that is asked for in each frame arrives.
//   - There are never more than `most` nodes. Where more are required, in use or asked for, than
//     that, detailFactor() grows until they fit, and goes back only when well below: it settles.
//
// Deterministic in the order of calls. Memory: most * 682 * 28 bytes, 30 bytes a node of the file.
// Not thread-safe.

#include <span>
#include <vector>

#include "methods/pmesh/adaption.h"
#include "methods/pmesh/operation_node.h"

namespace pietra::pmesh {

/// What tolerances are multiplied by; shared by all models that share a memory.
class DetailFactor {
public:
    double value() const { return value_; }
    void update(size_t required, size_t most) {
        if (required > most) {
            value_ *= 1.05;
        } else if (double(required) < 0.85 * double(most)) {
            value_ = std::max(value_ / 1.02, 1.0);
        }
    }

private:
    double value_ = 1;
};

class ResidentNodes : public References {
public:
    /// Of `forest`, whose nodes but the roots may be empty. CHECKs that roots fit.
    ResidentNodes(NodeForest forest, uint32_t most);

    /// As far as it is there. For Adaption, with this as its references.
    const ProgressiveMesh& mesh() const { return mesh_; }
    Reference referenceTo(OperationId id) const override;

    /// After each frame. Loaded nodes must not have changed since.
    void note(const Adaption& adaption);
    /// At most so many, none loaded, in the order of need.
    std::vector<NodeIndex> requests(size_t most) const;
    /// A node without faults. False, and nothing done, where it has no room or is not wanted: its
    /// parent has left.
    [[nodiscard]] bool arrive(NodeIndex index, const OperationNode& node);
    /// False, and nothing done, if it must stay.
    [[nodiscard]] bool evict(NodeIndex index);

    bool isLoaded(NodeIndex n) const {
        return mesh_.place_of_node[n] != ProgressiveMesh::kNotLoaded;
    }
    size_t loaded() const { return loaded_; }
    size_t required() const { return required_; }  ///< in use or asked for, by the last frame

private:
    struct State {
        uint32_t asked = 0;      ///< frames in a row
        uint32_t last_used = 0;  ///< the frame
        uint8_t loaded_children = 0;
        bool is_pinned = false;  ///< must stay
        bool is_in_use = false;  ///< by what waits for others
    };

    void pin(const ActiveMesh& mesh);
    bool makeRoom();

    ProgressiveMesh mesh_;
    std::vector<NodeRow> row_;
    std::vector<State> state_;
    std::vector<std::array<std::vector<uint16_t>, 2>> reference_level_;  // a place
    std::vector<uint32_t> free_place_;
    std::vector<NodeIndex> asked_;
    uint32_t frame_ = 0;
    size_t loaded_ = 0, required_ = 0;
};

}  // namespace pietra::pmesh
