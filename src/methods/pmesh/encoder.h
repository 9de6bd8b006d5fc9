#pragma once
// From collapses to nodes of splits: packed, then encoded from the coarse side, node by node. An
// operation's offsets are taken from where the decoder has its vertex, so that what rounding loses
// at one operation is made good by the next. Ranks count from the neighbour of the least name;
// names are places in nodes, known once all are packed, and the ring of neighbours was recorded
// with the collapse: so no mesh is needed, and nodes are encoded down one path of the tree after
// another.
//
// The output depends on the collapses alone. Memory: four bytes a vertex, and the nodes of a path;
// collapses and slots lie in temporary space.

#include <functional>

#include "methods/pmesh/collapses.h"
#include "methods/pmesh/operation_node.h"

namespace pietra::pmesh {

struct BuildCounts {
    uint64_t irregular_vertices = 0;  ///< locked: ends of non-manifold edges, bow-ties
    Recorder::Refused refused;
    uint32_t levels = 0;
    uint64_t operations = 0;
    uint64_t dummies = 0;
    uint64_t inexact_ends = 0;   ///< vertices that no operation brings exactly to their places
    uint32_t largest_error = 0;  ///< of these, in steps along an axis
    /// One a vertex: set where it had this size, for tests, whose vertices are told by places.
    std::vector<uint32_t> name_of;
};

/// Told of each node once, after its children.
using NodeSink = std::function<void(NodeIndex, const NodeRow&, OperationNode&)>;

/// The base mesh; rows and nodes go to the sink. There is one at least.
NodeForest encode(const Collapses& collapses, const Lattice& lattice, TempSpace& space,
                  BuildCounts& counts, const NodeSink& sink);

}  // namespace pietra::pmesh
