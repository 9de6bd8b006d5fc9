#pragma once
// One view on one model whose refinement is by groups of nodes: what of it to draw in this frame
// with what is resident, and which pages would make it finer, in the order of need (Cignoni et al.
// 2004, section 4). Neither waits nor touches a file.

#include <span>
#include <vector>

#include "multires/cut.h"
#include "runtime/residency.h"

namespace pietra {

struct PageRequest {
    PageIndex page = 0;
    float pixels = 0;  ///< the error on screen of what it would refine; largest first
};

struct Selection {
    std::vector<NodeIndex> draw;
    /// Pages that are missing, each once, largest error first, none before those it depends on.
    std::vector<PageRequest> requests;
    /// Largest error on screen of what is drawn, in pixels; infinite where the eye is inside a
    /// sphere that could not be refined.
    double largest_px = 0;
    uint64_t triangles = 0;
};

class ForestRefiner {
public:
    explicit ForestRefiner(const Residency& residency);

    /// Overwrites `selection`. All roots must be resident. Every node drawn that is not culled
    /// shows at most `pixels` of error, or waits for the pages requested. Linear in the groups
    /// visited.
    void select(const View& view, double pixels, const Culling& culling, Selection& selection);
    /// Appends what another view would request first and select() has not: after it, in the same
    /// frame. Of what is below that nothing yet, so that this takes no longer than select().
    void prefetch(const View& view, double pixels, const Culling& culling,
                  std::vector<PageRequest>& requests);

    /// visit(node) for each node of the cut that nothing is culled from, as far as it is resident.
    template <class Visit>
    void visitDrawable(const View& view, double pixels, const Visit& visit_node) {
        visit(
            view, pixels, {}, Missed::kFirst, [&](NodeIndex i, double) { visit_node(i); },
            [](uint32_t) {});
    }

    /// The last select() could not have drawn what it did without this page.
    bool used(PageIndex page) const { return page_used_[page] == selects_; }

private:
    /// A group that should be refined and is not open.
    struct Missing {
        uint32_t group;
        float pixels;
    };

    /// Of what is missing: all levels of it, or the first one.
    enum class Missed { kAll, kFirst };

    template <class Draw, class Refined>
    void visit(const View& view, double pixels, const Culling& culling, Missed missed,
               const Draw& draw, const Refined& refined);
    void requestMissing(std::vector<PageRequest>& requests);
    void use(uint32_t group);
    void request(uint32_t group, float pixels, std::vector<PageRequest>& requests);
    void requestPage(PageIndex page, float pixels, std::vector<PageRequest>& requests);

    const Residency& residency_;
    const Forest& forest_;
    struct Visited {
        NodeIndex node;
        bool covered;  // a node above it is drawn, as its group is not open
    };
    std::vector<Visited> level_, next_level_;
    std::vector<Missing> missing_;
    std::vector<uint32_t> group_used_, page_used_;            // by which select() last
    std::vector<uint32_t> group_requested_, page_requested_;  // in which round last
    uint32_t selects_ = 0, round_ = 0;
};

/// Top-down over what may be visible: draw(node, pixels of error), refined(group) for those that
/// are refined. Those that should be go to `missing_`, and likewise what should be below them, if
/// all levels that are missing are to be asked for at once. Level by level, so that nodes are on
/// their way to the cache long before they are looked at.
template <class Draw, class Refined>
void ForestRefiner::visit(const View& view, double pixels, const Culling& culling, Missed missed,
                          const Draw& draw, const Refined& refined) {
    missing_.clear();
    next_level_.clear();
    for (const NodeIndex root : forest_.roots()) next_level_.push_back({root, false});
    while (!next_level_.empty()) {
        level_.swap(next_level_);
        next_level_.clear();
        for (const auto [i, covered] : level_) {
            const Node& node = forest_.node(i);
            if (branchInvisible(node, view, pixels, culling)) continue;
            const double error = view.errorInPixels(node.error, node.saturated);
            const bool refine = !node.isLeaf() && !(error <= pixels);
            const bool open = refine && residency_.open(forest_.groupOf(i));
            if (open) refined(forest_.groupOf(i));
            if (refine && !open) missing_.push_back({forest_.groupOf(i), float(error)});
            if (!open && !covered && !patchInvisible(node, view, pixels, culling)) draw(i, error);
            if (!refine || (!open && missed == Missed::kFirst)) continue;
            for (const NodeIndex child : node.child)
                if (child != kNoNode) {
                    next_level_.push_back({child, !open});
                    forest_.prefetch(child);
                }
        }
    }
}

}  // namespace pietra
