#include "methods/cluster/octree.h"

#include <algorithm>

#include "base/check.h"

namespace pietra::cluster {

Octree::Octree(std::vector<CellId> leaves) : leaves_(std::move(leaves)) {
    for (const CellId leaf : leaves_) deepest_ = std::max(deepest_, depthOf(leaf));
}

size_t Octree::leafNumber(CellId cell) const {
    const auto at = std::lower_bound(leaves_.begin(), leaves_.end(), cell, [](CellId a, CellId b) {
        return firstPath(a) < firstPath(b);
    });
    CHECK(at != leaves_.end() && *at == cell);
    return size_t(at - leaves_.begin());
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
