#include "runtime/residency.h"

#include "base/check.h"

namespace pietra {

Residency::Residency(const Forest& forest, uint32_t page_count)
    : forest_(&forest),
      nodes_(forest.nodes().size()),
      first_node_(size_t(page_count) + 1, 0),
      resident_(page_count, 0),
      missing_children_(forest.groupCount(), 0),
      children_lost_(forest.groupCount(), 0) {
    const auto count = NodeIndex(nodes_.size());
    for (NodeIndex i = 0; i < count; ++i) ++first_node_[forest.node(i).page + 1];
    for (size_t page = 1; page <= page_count; ++page) first_node_[page] += first_node_[page - 1];
    std::vector<uint32_t> end = first_node_;
    for (NodeIndex i = 0; i < count; ++i) {
        nodes_[end[forest.node(i).page]++] = i;
        const NodeIndex parent = forest.parent(i);
        if (parent != kNoNode) ++missing_children_[forest.groupOf(parent)];
    }
}

/// Once for each node of the page.
template <class Body>
void Residency::forGroupsAbove(PageIndex page, const Body& body) {
    for (uint32_t k = first_node_[page]; k < first_node_[page + 1]; ++k)
        if (const NodeIndex parent = forest_->parent(nodes_[k]); parent != kNoNode)
            body(forest_->groupOf(parent));
}

void Residency::arrive(PageIndex page) {
    CHECK(!resident(page));
    resident_[page] = 1;
    forGroupsAbove(page, [&](uint32_t group) { --missing_children_[group]; });
}

void Residency::leave(PageIndex page) {
    CHECK(resident(page));
    resident_[page] = 0;
    forGroupsAbove(page, [&](uint32_t group) { ++missing_children_[group]; });
}

void Residency::lose(PageIndex page) {
    forGroupsAbove(page, [&](uint32_t group) { children_lost_[group] = 1; });
}

}  // namespace pietra
