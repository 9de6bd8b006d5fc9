#pragma once
// Which pages of a model are in memory, and what may therefore be drawn (DESIGN: "Selection under
// asynchronous loading").
//
// A page depends on the pages that hold the parents of its nodes: the resident set is closed
// upward, on arrival as on eviction. A group of nodes is *open*, it may be refined, when all pages
// of its children are resident and the groups of its own nodes' parents are open. So a cut that
// refines only open groups is a valid cut of the model, whatever has arrived.
//
// Memory: some 50 bytes a group and 30 a page. Pages arrive and leave in time linear in their nodes
// and in the groups that open or close by it. Not thread-safe.

#include <cstdint>
#include <span>
#include <vector>

#include "multires/forest.h"

namespace pietra {

using PageIndex = uint32_t;

/// Lists of lists in two arrays.
class Adjacency {
public:
    /// `pairs`: (of which list, what); each list in increasing order, doubles dropped.
    Adjacency(uint32_t lists, const std::vector<std::pair<uint32_t, uint32_t>>& pairs);
    std::span<const uint32_t> of(uint32_t list) const {
        return {item_.data() + begin_[list], size_t(begin_[list + 1] - begin_[list])};
    }

private:
    std::vector<uint32_t> begin_, item_;
};

class Residency {
public:
    /// Nothing is resident. `forest` must outlive this; pages are those of its nodes.
    Residency(const Forest& forest, uint32_t page_count);

    bool resident(PageIndex page) const { return resident_[page] != 0; }
    /// All pages that it depends on are resident.
    bool mayArrive(PageIndex page) const { return missing_parents_[page] == 0; }
    /// No resident page depends on it.
    bool mayLeave(PageIndex page) const { return resident_children_[page] == 0; }
    /// The page must not be resident, and mayArrive().
    void arrive(PageIndex page);
    /// The page must be resident, and mayLeave().
    void leave(PageIndex page);

    /// All nodes of the group may be replaced by their children. Never true of leaves.
    bool open(uint32_t group) const { return shut_by_[group] == 0; }

    const Forest& forest() const { return *forest_; }
    /// Pages that must be resident before this one.
    std::span<const uint32_t> pagesAbove(PageIndex page) const { return above_.of(page); }
    /// Pages of the children of a group's nodes.
    std::span<const uint32_t> childPages(uint32_t group) const { return child_pages_.of(group); }
    /// Groups of whose nodes it holds children.
    std::span<const uint32_t> groupsAbove(PageIndex page) const {
        return groups_above_page_.of(page);
    }
    /// Groups that must be refined before this one.
    std::span<const uint32_t> parentGroups(uint32_t group) const {
        return parent_groups_.of(group);
    }

private:
    void shut(uint32_t group);
    void unshut(uint32_t group);

    const Forest* forest_;
    Adjacency above_, below_;                    // between pages
    Adjacency child_pages_, groups_above_page_;  // groups and the pages of their children
    Adjacency parent_groups_, child_groups_;
    std::vector<uint8_t> resident_;
    std::vector<uint32_t> missing_parents_, resident_children_;  // a page
    std::vector<uint32_t> shut_by_;  // a group: missing pages of children and shut parent groups
    std::vector<uint32_t> stack_;
};

}  // namespace pietra
