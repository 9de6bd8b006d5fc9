#pragma once
// From buckets to leaf cells: welds every bucket, lets buckets tell each other what they know,
// builds and closes the tree of cells, finds the closed components, and stores each leaf's mesh.
// Two passes over the buckets, in parallel; memory O(a bucket) a thread, plus the tree, plus the
// table of the components that buckets share.

#include <memory>
#include <unordered_map>
#include <vector>

#include "coarsen/cell_store.h"
#include "coarsen/cell_tree.h"
#include "coarsen/partition.h"

namespace pietra {

struct LeafSettings {
    uint32_t leaf_triangles = 4000;
    float bound = 0;  ///< quantisation error: the bounds of every leaf face, lattice units
    size_t component_bytes = 1 << 20;  ///< memory for joining components, at least this
    bool mark_irregular = false;       ///< as weldBucket() says
};

struct Leaves {
    std::unique_ptr<CellTree> tree;
    std::unordered_map<CellId, CellBlob> blobs;  ///< of the leaves that have triangles
    uint64_t triangles = 0;
    uint64_t duplicates = 0;
    EdgeCounts edges;
};

/// Consumes the partition's records. `store` receives the leaves' meshes.
Leaves buildLeaves(Partition& partition, const VertexRecord& record, const LeafSettings& settings,
                   TempSpace& space, CellStore& store, Progress& progress);

}  // namespace pietra
