#pragma once
// From collapses to splits: packed into nodes, then replayed from the coarse side in a closed loop:
// an operation's offsets are taken from where the decoder has its vertex, so that what rounding
// loses at one operation is made good by the next. Ranks count names, which are places in nodes: so
// packing comes first.
//
// The output depends on the arguments alone. Memory: kEncodeBytes a triangle, the collapses
// included.

#include "methods/pmesh/operation_node.h"
#include "methods/pmesh/recorder.h"

namespace pietra::pmesh {

inline constexpr size_t kEncodeBytes = 160;

struct BuildCounts {
    uint64_t irregular_vertices = 0;  ///< locked: ends of non-manifold edges, bow-ties
    Recorder::Refused refused;
    uint32_t levels = 0;
    uint64_t operations = 0;
    uint64_t dummies = 0;
    uint64_t inexact_ends = 0;      ///< vertices that no operation brings exactly to their places
    uint32_t largest_error = 0;     ///< of these, in steps along an axis
    std::vector<NodeRow> row;       ///< for toNodes()
    std::vector<uint32_t> name_of;  ///< one an input vertex, kNoVertex for those without triangles
};

ProgressiveMesh encode(const Collapses& collapses, const Lattice& lattice, BuildCounts& counts);

}  // namespace pietra::pmesh
