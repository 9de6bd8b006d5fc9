#pragma once
// The table of cells: which cells of the hierarchy exist, and which are leaves. Built from the leaf
// cells that the buckets found; closed so that a diamond is split only as a whole (Cignoni et al.
// 2004, section 3): where one cell of a diamond is split, every other cell of it that holds
// triangles exists and is split too. A few tens of bytes a cell; the only data that grow with the
// input.

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "base/state.h"
#include "coarsen/bucket_mesh.h"
#include "coarsen/cell_path.h"

namespace pietra {

class CellTree {
public:
    /// `leaves`: disjoint, in any order. Small neighbours are merged into their parent while it
    /// stays within `leaf_triangles`; then diamonds are closed by forced splits.
    /// Cubes are merged eight at a time, and there are no diamonds to close, nor splitCells().
    CellTree(std::span<const LeafCell> leaves, uint32_t leaf_triangles,
             CellShape shape = CellShape::kTetrahedra);
    /// The one that was saved.
    explicit CellTree(StateReader& state);
    void save(StateWriter& state) const;

    /// Deepest level that has cells.
    int deepestLevel() const { return deepest_; }
    /// In path order. A forced split may leave a leaf without triangles.
    const std::vector<CellId>& leaves() const { return leaves_; }
    /// Split cells of a level, in path order.
    const std::vector<CellId>& splitCells(int level) const { return split_[size_t(level)]; }
    size_t forcedSplits() const { return forced_; }

private:
    void mergeSmall(uint32_t leaf_triangles);
    void mergeCubes(uint32_t leaf_triangles);
    void findSplit();
    void close();
    void closeDiamond(CellId cell);
    void forceSplit(CellId cell);
    void splitLeaf(CellId cell);
    void markSplit(CellId cell);

    std::unordered_map<CellId, LeafCell> leaf_;  // during construction
    std::unordered_map<CellId, bool> is_split_;
    std::vector<std::vector<CellId>> split_;
    std::vector<CellId> leaves_;
    int deepest_ = 0;
    size_t forced_ = 0;
};

}  // namespace pietra
