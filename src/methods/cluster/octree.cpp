#include "methods/cluster/octree.h"

#include <algorithm>

#include "base/check.h"

namespace pietra::cluster {

namespace {

bool comesBefore(CellId a, CellId b) {
    return firstPath(a) < firstPath(b);
}

}  // namespace

Box3i cubeOf(CellId cell) {
    const int bits = kLatticeBits - depthOf(cell);
    if (cell == 1) return {Vec3i(0), Vec3i(kLatticeMax)};
    Vec3i corner(0);
    for (int bit = bits; cell > 1; cell >>= 3, ++bit)
        corner |= Vec3i(int32_t(cell & 1), int32_t(cell >> 1 & 1), int32_t(cell >> 2 & 1)) << bit;
    return {corner, glm::min(corner + ((1 << bits) - 1), Vec3i(kLatticeMax))};
}

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
