#include "runtime/forest_refiner.h"

#include <algorithm>

namespace pietra {

ForestRefiner::ForestRefiner(const Residency& residency)
    : residency_(residency),
      forest_(residency.forest()),
      group_used_(forest_.groupCount(), 0),
      group_requested_(forest_.groupCount(), 0) {
    PageIndex pages = 0;
    for (const Node& node : forest_.nodes()) pages = std::max(pages, node.page + 1);
    page_used_.assign(pages, 0);
    page_requested_.assign(pages, 0);
}

void ForestRefiner::select(const View& view, double pixels, const Culling& culling,
                           Selection& selection) {
    selection = {std::move(selection.draw), std::move(selection.requests), 0, 0};
    selection.draw.clear();
    selection.requests.clear();
    ++selects_;
    ++round_;
    for (const NodeIndex root : forest_.roots()) page_used_[forest_.node(root).page] = selects_;
    visit(
        view, pixels, culling, Missed::kAll,
        [&](NodeIndex i, double error) {
            selection.draw.push_back(i);
            selection.triangles += forest_.node(i).triangles;
            if (!forest_.node(i).isLeaf())
                selection.largest_px = std::max(selection.largest_px, error);
        },
        [&](uint32_t group) { use(group); });
    std::sort(selection.draw.begin(), selection.draw.end());
    requestMissing(selection.requests);
}

void ForestRefiner::prefetch(const View& view, double pixels, const Culling& culling,
                             std::vector<PageRequest>& requests) {
    visit(
        view, pixels, culling, Missed::kFirst, [](NodeIndex, double) {}, [](uint32_t) {});
    requestMissing(requests);
}

/// Largest error first, so that a page stands where the first group that needs it does.
void ForestRefiner::requestMissing(std::vector<PageRequest>& requests) {
    std::sort(missing_.begin(), missing_.end(), [](const Missing& a, const Missing& b) {
        return a.pixels != b.pixels ? a.pixels > b.pixels : a.group < b.group;
    });
    for (const Missing& m : missing_) request(m.group, m.pixels, requests);
}

/// What keeps the group open: the pages of its children, and of those of all groups above it.
void ForestRefiner::use(uint32_t group) {
    if (group_used_[group] == selects_) return;
    group_used_[group] = selects_;
    for (const PageIndex page : residency_.childPages(group)) page_used_[page] = selects_;
    for (const uint32_t parent : residency_.parentGroups(group)) use(parent);
}

/// What is missing for the group to open, from above down.
void ForestRefiner::request(uint32_t group, float pixels, std::vector<PageRequest>& requests) {
    if (group_requested_[group] == round_ || residency_.open(group)) return;
    group_requested_[group] = round_;
    for (const uint32_t parent : residency_.parentGroups(group)) request(parent, pixels, requests);
    for (const PageIndex page : residency_.childPages(group)) requestPage(page, pixels, requests);
}

void ForestRefiner::requestPage(PageIndex page, float pixels, std::vector<PageRequest>& requests) {
    if (page_requested_[page] == round_ || residency_.resident(page)) return;
    page_requested_[page] = round_;
    for (const PageIndex above : residency_.pagesAbove(page)) requestPage(above, pixels, requests);
    requests.push_back({page, pixels});
}

}  // namespace pietra
