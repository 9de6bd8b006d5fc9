#include "runtime/forest_refiner.h"

#include <algorithm>

namespace pietra {

ForestRefiner::ForestRefiner(const Residency& residency)
    : residency_(residency),
      forest_(residency.forest()),
      group_open_(forest_.groupCount(), 0),
      page_used_(residency.pageCount(), 0),
      page_requested_(residency.pageCount(), 0) {}

void ForestRefiner::select(const View& view, double pixels, const Culling& culling,
                           Selection& selection) {
    selection = {std::move(selection.draw), std::move(selection.requests), 0, 0};
    selection.draw.clear();
    selection.requests.clear();
    ++selects_;
    ++round_;
    for (const NodeIndex root : forest_.roots()) page_used_[forest_.node(root).page] = selects_;
    visit(
        {view, pixels, culling}, Missed::kAll,
        [&](NodeIndex i, double error) {
            selection.draw.push_back(i);
            selection.triangles += forest_.node(i).triangles;
            if (!forest_.node(i).isLeaf())
                selection.largest_px = std::max(selection.largest_px, error);
        },
        [&](NodeIndex i) { page_used_[forest_.node(i).page] = selects_; });
    std::sort(selection.draw.begin(), selection.draw.end());
    listMissing(selection.requests);
}

void ForestRefiner::prefetch(const View& view, double pixels, const Culling& culling,
                             std::vector<PageRequest>& requests) {
    visit(
        {view, pixels, culling}, Missed::kFirst, [](NodeIndex, double) {}, [](NodeIndex) {});
    listMissing(requests);
}

/// Largest error first, so that a page stands where the first node that needs it does.
void ForestRefiner::listMissing(std::vector<PageRequest>& requests) {
    std::sort(missing_.begin(), missing_.end(), [](const PageRequest& a, const PageRequest& b) {
        return a.pixels != b.pixels ? a.pixels > b.pixels : a.page < b.page;
    });
    for (const PageRequest& request : missing_) {
        if (page_requested_[request.page] == round_) continue;
        page_requested_[request.page] = round_;
        requests.push_back(request);
    }
}

bool ForestRefiner::open(uint32_t group, const Sight& sight) {
    if (group_open_[group] >> 1 == visits_) return group_open_[group] & 1;
    bool is_open = residency_.childrenResident(group) || seenChildrenResident(group, sight);
    for (const NodeIndex i : forest_.members(group)) {
        if (!is_open) break;
        const NodeIndex parent = forest_.node(i).is_joint ? kNoNode : forest_.parent(i);
        if (parent != kNoNode) is_open = open(forest_.groupOf(parent), sight);
    }
    group_open_[group] = visits_ << 1 | uint32_t(is_open);
    return is_open;
}

bool ForestRefiner::seenChildrenResident(uint32_t group, const Sight& sight) const {
    bool all = true;
    for (const NodeIndex i : forest_.members(group))
        forest_.node(i).forEachChild([&](NodeIndex child) {
            all = all && (residency_.resident(forest_.node(child).page) ||
                          !sight.shows(forest_.node(child)));
        });
    return all;
}

}  // namespace pietra
