#include "coarsen/cell_tree.h"

#include <algorithm>
#include <unordered_set>

#include "base/check.h"

namespace pietra {

namespace {

constexpr int kOccupiedLevels = 6;

/// Of the 64 descendants six levels below a cell, those below `descendant`; `deeper` = its level
/// less the cell's, at most 6.
uint64_t occupancyRange(CellId descendant, int deeper) {
    const uint64_t within = descendant & ((uint64_t(1) << deeper) - 1);
    const int width = 1 << (kOccupiedLevels - deeper);
    const uint64_t ones = width == 64 ? ~uint64_t(0) : (uint64_t(1) << width) - 1;
    return ones << (within * uint64_t(width));
}

/// What a child's occupancy is, as far as its parent's tells: one level less is known.
uint64_t childOccupancy(uint64_t parent, int bit) {
    uint64_t child = 0;
    for (int i = 0; i < 64; ++i) child |= (parent >> (32 * bit + i / 2) & 1) << i;
    return child;
}

uint64_t parentOccupancy(uint64_t child, int bit) {
    uint64_t parent = 0;
    for (int i = 0; i < 64; ++i) parent |= (child >> i & 1) << (32 * bit + i / 2);
    return parent;
}

}  // namespace

CellTree::CellTree(std::span<const LeafCell> leaves, uint32_t leaf_triangles, CellShape shape) {
    leaf_.reserve(leaves.size() * 2);
    for (const LeafCell& leaf : leaves) leaf_.emplace(leaf.cell, leaf);
    CHECK_EQ(leaf_.size(), leaves.size());
    if (shape == CellShape::kCubes)
        mergeCubes(leaf_triangles);
    else
        mergeSmall(leaf_triangles);
    for (const auto& [cell, leaf] : leaf_) deepest_ = std::max(deepest_, cellLevel(cell));
    if (shape == CellShape::kTetrahedra) {
        findSplit();
        close();
    }
    for (std::vector<CellId>& level : split_) std::sort(level.begin(), level.end());
    leaves_.reserve(leaf_.size());
    for (const auto& [cell, leaf] : leaf_) leaves_.push_back(cell);
    std::sort(leaves_.begin(), leaves_.end(),
              [](CellId a, CellId b) { return firstPath(a) < firstPath(b); });
    leaf_.clear();
    is_split_.clear();
}

CellTree::CellTree(StateReader& state) : split_(state.get<size_t>()) {
    for (std::vector<CellId>& level : split_) state.get(level);
    state.get(leaves_);
    state.get(deepest_);
    state.get(forced_);
}

void CellTree::save(StateWriter& state) const {
    state.put(split_.size());
    for (const std::vector<CellId>& level : split_) state.put(level);
    state.put(leaves_);
    state.put(deepest_);
    state.put(forced_);
}

void CellTree::mergeSmall(uint32_t leaf_triangles) {
    std::vector<std::vector<CellId>> by_level(kMaxCellLevel + 1);
    std::unordered_set<CellId> has_split_child;  // cells that cannot become leaves
    const auto keepSplit = [&](CellId parent) {
        while (parent > 1 && has_split_child.insert(parent).second) parent = cellParent(parent);
    };
    for (const auto& [cell, leaf] : leaf_) by_level[size_t(cellLevel(cell))].push_back(cell);
    for (int level = kMaxCellLevel; level > 0; --level)
        for (CellId cell : by_level[size_t(level)]) {
            const auto at = leaf_.find(cell);
            if (at == leaf_.end()) continue;  // merged with its sibling already
            const CellId parent = cellParent(cell), sibling = cell ^ 1;
            const auto other = leaf_.find(sibling);
            const uint64_t total = uint64_t(at->second.triangles) +
                                   (other == leaf_.end() ? 0 : other->second.triangles);
            if (total > leaf_triangles || has_split_child.count(sibling) ||
                has_split_child.count(cell)) {
                keepSplit(parent);
                continue;
            }
            uint64_t occupied = parentOccupancy(at->second.occupied, int(cell & 1));
            if (other != leaf_.end())
                occupied |= parentOccupancy(other->second.occupied, int(sibling & 1));
            leaf_.erase(cell);
            leaf_.erase(sibling);
            leaf_.emplace(parent, LeafCell{parent, uint32_t(total), occupied});
            by_level[size_t(level - 1)].push_back(parent);
        }
}

/// All eight, as far as they have triangles, where they are leaves.
void CellTree::mergeCubes(uint32_t leaf_triangles) {
    std::vector<CellId> level;  // the cells of one level, leaves or not
    for (int depth = kMaxCellLevel; depth > 0; depth -= 3) {
        std::unordered_map<CellId, uint64_t> triangles;  // of parents; too many where one is split
        for (const auto& [cell, leaf] : leaf_)
            if (cellLevel(cell) == depth) level.push_back(cell);
        for (const CellId cell : level) {
            const auto leaf = leaf_.find(cell);
            triangles[cell >> 3] +=
                leaf == leaf_.end() ? uint64_t(leaf_triangles) + 1 : leaf->second.triangles;
        }
        level.clear();
        for (const auto& [parent, count] : triangles) {
            if (count > leaf_triangles) {
                level.push_back(parent);
                continue;
            }
            for (CellId child = parent << 3; child < (parent + 1) << 3; ++child) leaf_.erase(child);
            leaf_.emplace(parent, LeafCell{parent, uint32_t(count), 0});
        }
    }
}

void CellTree::findSplit() {
    for (const auto& [cell, leaf] : leaf_)
        for (CellId up = cell; cellLevel(up) > 0;) {
            up = cellParent(up);
            if (!is_split_.emplace(up, true).second) break;
        }
    split_.resize(size_t(deepest_) + 1);
    for (const auto& [cell, unused] : is_split_) split_[size_t(cellLevel(cell))].push_back(cell);
}

void CellTree::close() {
    // From the deepest level up: closing a diamond splits cells of its own level and of coarser
    // ones.
    for (int level = deepest_; level >= 0; --level) {
        std::unordered_set<uint64_t> seen;
        for (size_t i = 0; i < split_[size_t(level)].size(); ++i) {
            const CellId cell = split_[size_t(level)][i];
            if (seen.insert(diamondKey(cell)).second) closeDiamond(cell);
        }
    }
}

void CellTree::closeDiamond(CellId cell) {
    for (CellId member : diamondCells(cell)) forceSplit(member);
}

// Splits the leaf that covers `cell`, and its descendants, until `cell` itself is split; nothing
// where the cell holds no triangles.
void CellTree::forceSplit(CellId cell) {
    for (;;) {
        if (is_split_.count(cell)) return;
        CellId cover = cell;
        int deeper = 0;
        while (!leaf_.count(cover) && !is_split_.count(cover)) {
            if (cellLevel(cover) == 0) return;  // an empty root
            cover = cellParent(cover);
            ++deeper;
        }
        if (is_split_.count(cover)) return;  // the child towards `cell` has no triangles
        const uint64_t range =
            occupancyRange(deeper <= kOccupiedLevels ? cell : cell >> (deeper - 6),
                           std::min(deeper, kOccupiedLevels));
        if ((leaf_.at(cover).occupied & range) == 0) return;
        splitLeaf(cover);
        ++forced_;
    }
}

void CellTree::splitLeaf(CellId cell) {
    const LeafCell leaf = leaf_.at(cell);
    leaf_.erase(cell);
    markSplit(cell);
    for (int bit : {0, 1}) {
        const uint64_t occupied = childOccupancy(leaf.occupied, bit);
        if (occupied == 0) continue;
        const CellId child = cellChild(cell, bit);
        leaf_.emplace(child, LeafCell{child, leaf.triangles / 2, occupied});
    }
}

void CellTree::markSplit(CellId cell) {
    is_split_.emplace(cell, true);
    split_[size_t(cellLevel(cell))].push_back(cell);
}

}  // namespace pietra
