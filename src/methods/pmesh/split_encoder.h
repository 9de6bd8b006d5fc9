#pragma once
// From collapses to nodes of splits: packed, leaves numbered, then node by node, each by itself. No
// mesh is needed: a collapse has all that its split says, but for the leaves of third corners
// (wing_leaves.h).
//
// The output depends on the collapses alone. Memory: four bytes a vertex, if there is so much, and
// 20 a node; collapses and slots lie in temporary space.

#include <functional>

#include "methods/pmesh/collapses.h"
#include "methods/pmesh/split_node.h"

namespace pietra::pmesh {

struct BuildCounts {
    uint64_t irregular_vertices = 0;  ///< locked: ends of non-manifold edges, bow-ties
    Recorder::Refused refused;
    uint32_t levels = 0;  ///< the longest chain of dependencies
    uint64_t operations = 0;
    /// The first one of each vertex; set where it had this size, for tests, whose vertices are told
    /// by places.
    std::vector<Leaf> leaf_of;
};

/// Told of each node once, after its children. One thread.
using SplitSink = std::function<void(NodeIndex, const SplitRow&, const SplitGrid&, SplitNode&)>;

/// Without rows and nodes: these go to the sink. There is one at least.
SplitForest encodeSplits(const Collapses& collapses, const Lattice& lattice, TempSpace& space,
                         BuildCounts& counts, const SplitSink& sink);

}  // namespace pietra::pmesh
