#pragma once
// What there is to do in one level of the hierarchy, from fine to coarse: leaves to take over, and
// diamonds to make of the cells below.

#include <functional>
#include <vector>

#include "coarsen/leaves.h"

namespace pietra {

/// A leaf, or all split cells of one diamond, in path order.
struct LevelItem {
    std::vector<CellId> cells;
    bool is_leaf = false;
    uint64_t triangles = 0;  ///< expected
    CellPath path() const { return firstPath(cells[0]); }
};

/// In path order. `below`: the blob of a finished cell of the level below, or null.
std::vector<LevelItem> itemsOfLevel(const Leaves& leaves, int level,
                                    const std::function<const CellBlob*(CellId)>& below);

}  // namespace pietra
