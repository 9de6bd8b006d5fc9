#pragma once
// The octree of Wu and Huang 2014 and the layers of its cells (docs/design/cluster.md). Layers are
// numbered for the whole model, so that those of one number are about as coarse everywhere: a leaf
// at depth d of D begins with layer D - d, its input triangles, and has three more; a cell above
// the leaves has the one layer that follows its children's last. The root, of depth 0, is the top.
// Immutable, thread-safe.

#include <vector>

#include "coarsen/cell_path.h"
#include "geometry/bounds.h"

namespace pietra::cluster {

/// Layers of a leaf above its triangles.
inline constexpr int kLocalLayers = 3;

/// The root's is 1.
inline int depthOf(CellId cell) {
    return cellLevel(cell) / 3 + 1;
}

/// Of lattice points.
Box3i cubeOf(CellId cell);

/// A cell that gets a new layer, and those whose layers below it begins with: itself or children.
struct CellStep {
    CellId cell = 0;
    std::vector<CellId> below;
};

class Octree {
public:
    /// `leaves`: those with triangles, in path order.
    explicit Octree(std::vector<CellId> leaves);

    const std::vector<CellId>& leaves() const { return leaves_; }
    int topLayer() const { return deepest_ + kLocalLayers; }
    bool isLeaf(CellId cell) const;
    /// The leaf's number; it must be one.
    size_t leafNumber(CellId cell) const;
    /// The number of the leaf's first layer.
    int firstLayer(CellId leaf) const { return deepest_ - depthOf(leaf); }
    /// The cell that has the leaf's triangles in a layer, or in its first where that is later.
    CellId cellIn(CellId leaf, int layer) const {
        const int up = depthOf(leaf) - (topLayer() - layer);
        return up > 0 ? leaf >> (3 * up) : leaf;
    }
    /// What is to be done for a layer above 0, in path order.
    std::vector<CellStep> stepsOf(int layer) const;

private:
    std::vector<CellId> leaves_;
    int deepest_ = 0;
};

}  // namespace pietra::cluster
