#pragma once
// Which pages of a model are in memory: they come and go in any order. What may be drawn of them in
// a view, ForestRefiner tells.
//
// Memory: 4 bytes a node, 5 a group and 5 a page. Pages arrive and leave in time linear in their
// nodes. Not thread-safe.

#include <cstdint>
#include <span>
#include <vector>

#include "multires/forest.h"

namespace pietra {

using PageIndex = uint32_t;

class Residency {
public:
    /// Nothing is resident. `forest` must outlive this; pages are those of its nodes.
    Residency(const Forest& forest, uint32_t page_count);

    bool resident(PageIndex page) const { return resident_[page] != 0; }
    /// The page must not be resident.
    void arrive(PageIndex page);
    /// The page must be resident.
    void leave(PageIndex page);
    /// The page will never arrive.
    void lose(PageIndex page);

    /// The pages of all children of the group's nodes are resident. Always true of leaves.
    bool childrenResident(uint32_t group) const { return missing_children_[group] == 0; }
    /// Some of them will never be.
    bool childrenLost(uint32_t group) const { return children_lost_[group] != 0; }

    const Forest& forest() const { return *forest_; }
    uint32_t pageCount() const { return uint32_t(resident_.size()); }

private:
    template <class Body>
    void forGroupsAbove(PageIndex page, const Body& body);

    const Forest* forest_;
    std::vector<NodeIndex> nodes_;      // by page
    std::vector<uint32_t> first_node_;  // in nodes_, of each page; and the end
    std::vector<uint8_t> resident_;
    std::vector<uint32_t> missing_children_;  // nodes, of each group
    std::vector<uint8_t> children_lost_;
};

}  // namespace pietra
