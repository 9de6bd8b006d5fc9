#pragma once
// Cuts: sets of nodes whose patches together are one valid mesh. Offline selection for `extract`,
// `render` and `check`; the frame path has refiners of its own.
//
// A cut is made from the roots down: a node is drawn, or replaced by its existing children; a leaf
// is always drawn. All criteria here depend on (error, saturated sphere) alone and are monotone in
// them, so groups stay whole (node.h). Errors are in lattice units. Nodes without triangles are
// legal and are listed like all others. The table must have no bad links (checkForest), else
// BugError is thrown. Deterministic; linear in the table unless said otherwise. After Cignoni et
// al. 2004, section 4.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "multires/node.h"
#include "multires/view.h"

namespace pietra {

struct Cut {
    std::vector<NodeIndex> nodes;  ///< increasing
    float max_error = 0;           ///< the largest that a node of it states, lattice units
    uint64_t triangles = 0;
    bool below_finest =
        false;  ///< asked for less error than the finest cut states; this is that cut
    bool over_budget =
        false;  ///< even the roots have more triangles than asked for; these are they
};

Cut rootCut(std::span<const Node> nodes);
Cut finestCut(std::span<const Node> nodes);

/// The coarsest cut of which every node states at most `max_error`.
Cut cutByError(std::span<const Node> nodes, double max_error);

/// The cut of least error with at most `max_triangles` triangles. O(n log n).
Cut cutByTriangles(std::span<const Node> nodes, uint64_t max_triangles);

/// Refines while what the view selects by, a node's error or its faces, may show as more than
/// `pixels` in the picture; nothing is culled.
Cut cutByView(std::span<const Node> nodes, const View& view, double pixels);

/// All groups with more than `height` steps of simplification below them are refined
/// (Forest::groupHeights); 0 gives the finest cut.
Cut cutByHeight(std::span<const Node> nodes, int height);

struct Culling {
    bool frustum = false;       ///< leave out what is outside of the picture
    bool cone = false;          ///< leave out closed parts that face away
    bool contribution = false;  ///< leave out what shows smaller than half the tolerance
    bool occlusion = false;     ///< leave out what is hidden: for renderers, no matter of cuts
    bool operator==(const Culling&) const = default;
};

/// Nothing of the node nor of anything finer below it can be seen; judged by its saturated sphere,
/// so the same for all of its group.
bool branchInvisible(const Node& node, const View& view, double pixels, const Culling& culling);
/// Nothing of the node's own patch can be seen.
bool patchInvisible(const Node& node, const View& view, double pixels, const Culling& culling);

/// The nodes of cutByView() that can be seen: a subset of it, so no valid cut by itself. Branches
/// are left out by their saturated spheres, which hold all that is finer; nodes by their own
/// bounds.
Cut visibleCut(std::span<const Node> nodes, const View& view, double pixels,
               const Culling& culling);

/// A valid cut for tests, a function of table and seed: a threshold, a camera, or an arbitrary
/// choice of groups, closed so that it is valid.
Cut randomCut(std::span<const Node> nodes, uint64_t seed);

/// Empty if there is exactly one node of the cut on each path from a root to a leaf and every group
/// is refined as a whole or not at all; else a sentence about the first fault. Never throws on a
/// table without bad links, whatever the cut holds.
[[nodiscard]] std::string validateCut(std::span<const Node> nodes, std::span<const NodeIndex> cut);

}  // namespace pietra
