#include "methods/cluster/octree.h"

#include <algorithm>

#include "base/check.h"

namespace pietra::cluster {

namespace {

bool comesBefore(CellId a, CellId b) {
    return firstPath(a) < firstPath(b);
}

}  // namespace

Octree::Octree(std::vector<CellId> leaves) : leaves_(std::move(leaves)) {
    for (const CellId leaf : leaves_) deepest_ = std::max(deepest_, depthOf(leaf));
}

bool Octree::isLeaf(CellId cell) const {
    if (cell == 1) return false;
    const auto at = std::lower_bound(leaves_.begin(), leaves_.end(), cell, comesBefore);
    return at != leaves_.end() && *at == cell;
}

size_t Octree::leafNumber(CellId cell) const {
    CHECK(isLeaf(cell));
    return size_t(std::lower_bound(leaves_.begin(), leaves_.end(), cell, comesBefore) -
                  leaves_.begin());
}

std::vector<CellStep> Octree::stepsOf(int layer) const {
    std::vector<CellStep> steps;
    for (const CellId leaf : leaves_) {
        if (layer <= firstLayer(leaf)) continue;
        const CellId cell = cellIn(leaf, layer), below = cellIn(leaf, layer - 1);
        if (steps.empty() || steps.back().cell != cell) steps.push_back({cell, {}});
        if (steps.back().below.empty() || steps.back().below.back() != below)
            steps.back().below.push_back(below);
    }
    return steps;
}

}  // namespace pietra::cluster
