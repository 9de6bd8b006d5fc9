#include "runtime/residency.h"

#include <algorithm>

#include "base/check.h"

namespace pietra {
namespace {

using Pairs = std::vector<std::pair<uint32_t, uint32_t>>;

/// visit(parent, child) for each link of the forest.
template <class Visit>
Pairs linkPairs(const Forest& forest, const Visit& visit) {
    Pairs pairs;
    for (NodeIndex child = 0; child < forest.nodes().size(); ++child)
        if (const NodeIndex parent = forest.parent(child); parent != kNoNode)
            pairs.push_back(visit(parent, child));
    return pairs;
}

Pairs pagePairs(const Forest& forest, bool upward) {
    return linkPairs(forest, [&](NodeIndex parent, NodeIndex child) {
        const uint32_t above = forest.node(parent).page, below = forest.node(child).page;
        return upward ? std::pair(below, above) : std::pair(above, below);
    });
}

Pairs groupPairs(const Forest& forest, bool upward) {
    return linkPairs(forest, [&](NodeIndex parent, NodeIndex child) {
        const uint32_t above = forest.groupOf(parent), below = forest.groupOf(child);
        return upward ? std::pair(below, above) : std::pair(above, below);
    });
}

Pairs groupPagePairs(const Forest& forest, bool from_page) {
    return linkPairs(forest, [&](NodeIndex parent, NodeIndex child) {
        const uint32_t group = forest.groupOf(parent), page = forest.node(child).page;
        return from_page ? std::pair(page, group) : std::pair(group, page);
    });
}

}  // namespace

Adjacency::Adjacency(uint32_t lists, const Pairs& pairs) : item_(pairs.size()) {
    std::vector<uint32_t> end(size_t(lists) + 1, 0);
    for (const auto& [list, item] : pairs) ++end[list + 1];
    for (size_t i = 1; i < end.size(); ++i) end[i] += end[i - 1];
    begin_ = end;
    for (const auto& [list, item] : pairs) item_[end[list]++] = item;
    auto out = item_.begin();
    for (uint32_t list = 0; list < lists; ++list) {
        const auto first = item_.begin() + begin_[list], last = item_.begin() + end[list];
        std::sort(first, last);
        begin_[list] = uint32_t(out - item_.begin());
        out = std::copy(first, std::unique(first, last), out);
    }
    begin_[lists] = uint32_t(out - item_.begin());
    item_.erase(out, item_.end());
}

Residency::Residency(const Forest& forest, uint32_t page_count)
    : forest_(&forest),
      above_(page_count, pagePairs(forest, true)),
      below_(page_count, pagePairs(forest, false)),
      child_pages_(forest.groupCount(), groupPagePairs(forest, false)),
      groups_above_page_(page_count, groupPagePairs(forest, true)),
      parent_groups_(forest.groupCount(), groupPairs(forest, true)),
      child_groups_(forest.groupCount(), groupPairs(forest, false)),
      resident_(page_count, 0),
      resident_children_(page_count, 0) {
    for (PageIndex page = 0; page < page_count; ++page)
        missing_parents_.push_back(uint32_t(above_.of(page).size()));
    for (uint32_t group = 0; group < forest.groupCount(); ++group) {
        const size_t pages = child_pages_.of(group).size();
        // Of leaves one thing is always missing: children.
        shut_by_.push_back(uint32_t(std::max<size_t>(pages, 1) + parent_groups_.of(group).size()));
    }
}

void Residency::arrive(PageIndex page) {
    CHECK(!resident(page) && mayArrive(page));
    resident_[page] = 1;
    for (const PageIndex above : above_.of(page)) ++resident_children_[above];
    for (const PageIndex below : below_.of(page)) --missing_parents_[below];
    for (const uint32_t group : groups_above_page_.of(page)) unshut(group);
}

void Residency::leave(PageIndex page) {
    CHECK(resident(page) && mayLeave(page));
    resident_[page] = 0;
    for (const PageIndex above : above_.of(page)) --resident_children_[above];
    for (const PageIndex below : below_.of(page)) ++missing_parents_[below];
    for (const uint32_t group : groups_above_page_.of(page)) shut(group);
}

/// One thing more that the group waits for; where that shuts it, so do its children's groups.
void Residency::shut(uint32_t group) {
    stack_.push_back(group);
    while (!stack_.empty()) {
        const uint32_t g = stack_.back();
        stack_.pop_back();
        if (shut_by_[g]++ > 0) continue;
        for (const uint32_t child : child_groups_.of(g)) stack_.push_back(child);
    }
}

void Residency::unshut(uint32_t group) {
    stack_.push_back(group);
    while (!stack_.empty()) {
        const uint32_t g = stack_.back();
        stack_.pop_back();
        if (--shut_by_[g] > 0) continue;
        for (const uint32_t child : child_groups_.of(g)) stack_.push_back(child);
    }
}

}  // namespace pietra
