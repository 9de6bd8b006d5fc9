#pragma once
// Builds a progressive mesh from a whole welded mesh in memory: one simplification from end to end,
// every collapse recorded, then encoded from the coarse side in a closed loop: an operation's
// offsets are taken from where the decoder has its vertex, so that what rounding loses at one
// operation is made good by the next.
//
// The output depends on the mesh alone. Memory: kBuildBytes a triangle; MemoryError if the budget
// has less. Time: about two microseconds a triangle on one core.

#include "base/budget.h"
#include "methods/pmesh/operation_node.h"
#include "methods/pmesh/recorder.h"

namespace pietra::pmesh {

inline constexpr size_t kBuildBytes = 240;

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

/// `mesh`: welded, without degenerate or doubled triangles, with normals, all positions multiples
/// of 2^lattice.shift; its edge classes are set here.
ProgressiveMesh buildInCore(Mesh mesh, const Lattice& lattice, Budget& budget,
                            BuildCounts* counts = nullptr);

}  // namespace pietra::pmesh
