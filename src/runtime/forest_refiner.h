#pragma once
// One view on one model whose refinement is by groups of nodes: what of it to draw in this frame
// with what is resident, and which pages would make it finer, in the order of need (Cignoni et al.
// 2004, section 4). Neither waits nor touches a file.
//
// In a view, a group of nodes is *open*, it may be refined, when the pages of those of its
// children that may be seen are resident, and the groups of its own nodes' parents are open. What
// is drawn is what may be seen of the cut that refines all open groups that the view asks to
// refine: a valid cut of the model, whatever is resident, as long as the roots are. What cannot be
// seen needs no page.

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
    /// Pages that are missing, each once, largest error first.
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
    /// shows at most `pixels` of error, or waits for the pages requested. Linear in the nodes
    /// visited.
    void select(const View& view, double pixels, const Culling& culling, Selection& selection);
    /// Appends what another view would request first and select() has not: after it, in the same
    /// frame. Of what is below that nothing yet, so that this takes no longer than select().
    void prefetch(const View& view, double pixels, const Culling& culling,
                  std::vector<PageRequest>& requests);

    /// visit(node) for each node of the cut that nothing is culled from, as far as it is resident.
    /// Appends to `requests` what is missing for it.
    template <class Visit>
    void visitDrawable(const View& view, double pixels, const Visit& visit_node,
                       std::vector<PageRequest>& requests) {
        visit(
            {view, pixels, {}}, Missed::kAll, [&](NodeIndex i, double) { visit_node(i); },
            [](NodeIndex) {});
        ++round_;
        listMissing(requests);
    }

    /// The last select() drew some of the page, or looked at it on its way to what it drew or would
    /// draw if that were resident. What is not used may leave, and it draws the same.
    bool used(PageIndex page) const { return page_used_[page] == selects_; }

private:
    /// Of what is missing: all levels of it, or the first one.
    enum class Missed { kAll, kFirst };

    struct Sight {
        const View& view;
        double pixels;
        Culling culling;
        bool shows(const Node& node) const { return !patchInvisible(node, view, pixels, culling); }
    };
    template <class Draw, class Look>
    void visit(const Sight& sight, Missed missed, const Draw& draw, const Look& look);
    bool open(uint32_t group, const Sight& sight);
    /// Whatever arrives below it may never be drawn.
    bool isLost(NodeIndex i) const {
        const NodeIndex parent = forest_.parent(i);
        return parent != kNoNode && residency_.childrenLost(forest_.groupOf(parent));
    }
    bool seenChildrenResident(uint32_t group, const Sight& sight) const;
    void listMissing(std::vector<PageRequest>& requests);

    const Residency& residency_;
    const Forest& forest_;
    struct Visited {
        NodeIndex node;
        bool covered;  // a node above it is drawn, as its group is not open
        float error_above;
    };
    std::vector<Visited> level_, next_level_;
    std::vector<PageRequest> missing_;
    std::vector<uint32_t> group_open_;                  // 2 visits_, and one more if it is open
    std::vector<uint32_t> page_used_, page_requested_;  // by which select(), in which round, last
    uint32_t visits_ = 0, selects_ = 0, round_ = 0;
};

/// Top-down over what may be visible: look(node), and draw(node, pixels of error) for what is to be
/// drawn. What is missing goes to `missing_`. Level by level, so that nodes are on their way to the
/// cache long before they are looked at.
template <class Draw, class Look>
void ForestRefiner::visit(const Sight& sight, Missed missed, const Draw& draw, const Look& look) {
    ++visits_;
    missing_.clear();
    next_level_.clear();
    for (const NodeIndex root : forest_.roots()) next_level_.push_back({root, false, 0});
    while (!next_level_.empty()) {
        level_.swap(next_level_);
        next_level_.clear();
        for (const auto [i, covered, error_above] : level_) {
            const Node& node = forest_.node(i);
            if (branchInvisible(node, sight.view, sight.pixels, sight.culling)) continue;
            look(i);
            if (!residency_.resident(node.page) && sight.shows(node))
                missing_.push_back({node.page, error_above});
            const double error = sight.view.pixelsOf(node);
            const bool refine = !node.isLeaf() && !(error <= sight.pixels);
            const bool is_open = refine && !covered && open(forest_.groupOf(i), sight);
            if (!is_open && !covered && sight.shows(node)) draw(i, error);
            if (!refine || (covered && (missed == Missed::kFirst || isLost(i)))) continue;
            node.forEachChild([&](NodeIndex child) {
                next_level_.push_back({child, !is_open, float(error)});
                forest_.prefetch(child);
            });
        }
    }
}

}  // namespace pietra
