#pragma once
// The node table as a forest: parents, roots, groups, and whether it keeps the contract of node.h.
//
// A group is refined as a whole: all its nodes are replaced by their children at once. A group may
// be refined only once all its nodes exist, that is, once the groups of all their parents are
// refined; but for joints, which may come and go. Memory: 16 bytes a node. Complexity: linear, but
// for one sort of the group numbers. Immutable once built, so any number of threads may read it.
// Deterministic.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "multires/node.h"

namespace pietra {

/// What checkForest() found; all counts but the first two are of faults.
struct ForestReport {
    uint64_t nodes = 0;
    uint64_t links = 0;      ///< pairs of parent and child
    uint64_t bad_links = 0;  ///< a child that does not exist, has two parents, or lies on a cycle
    /// Unequal error, face size or sphere within, or leaves beside inner nodes.
    uint64_t broken_groups = 0;
    uint64_t not_monotone = 0;  ///< a child states a larger error or face size than its parent
    uint64_t not_nested = 0;  ///< `saturated` does not enclose own bounds or a child's `saturated`
    std::string first_fault;  ///< one sentence, empty if there is none
    bool ok() const { return first_fault.empty(); }
};

/// Examines a table of unknown origin; never throws, whatever the nodes hold. A table with bad
/// links is not examined further. A sphere may stick out by one part in 1e9, as float sums do.
[[nodiscard]] ForestReport checkForest(std::span<const Node> nodes);

class Forest {
public:
    /// `nodes` must outlive this and have no bad links (checkForest); throws BugError otherwise.
    explicit Forest(std::span<const Node> nodes);

    std::span<const Node> nodes() const { return nodes_; }
    const Node& node(NodeIndex i) const { return nodes_[i]; }
    /// Asks the cache for what node() and groupOf() look at.
    void prefetch(NodeIndex i) const {
        __builtin_prefetch(&nodes_[i]);
        __builtin_prefetch(reinterpret_cast<const char*>(&nodes_[i] + 1) - 1);
        __builtin_prefetch(&group_of_[i]);
    }
    /// kNoNode for a root.
    NodeIndex parent(NodeIndex i) const { return parent_[i]; }
    const std::vector<NodeIndex>& roots() const { return roots_; }

    /// Groups are counted from 0 in the order of their numbers in the table.
    uint32_t groupCount() const { return uint32_t(group_begin_.size() - 1); }
    uint32_t groupOf(NodeIndex i) const { return group_of_[i]; }
    /// The nodes of a group, in increasing order.
    std::span<const NodeIndex> members(uint32_t group) const {
        return {group_members_.data() + group_begin_[group],
                size_t(group_begin_[group + 1] - group_begin_[group])};
    }

    /// Steps of simplification below each group: 0 for groups of leaves, else one more than the
    /// highest among the groups of its children. Cuts at one height are valid.
    std::vector<uint16_t> groupHeights() const;
    /// Adds to `refined` (one flag a group) all groups that must be refined before those in it.
    void closeUpward(std::vector<uint8_t>& refined) const;

private:
    std::span<const Node> nodes_;
    std::vector<NodeIndex> parent_;
    std::vector<NodeIndex> roots_;
    std::vector<uint32_t> group_of_;
    std::vector<uint32_t> group_begin_;  // CSR, one more than there are groups
    std::vector<NodeIndex> group_members_;
};

}  // namespace pietra
