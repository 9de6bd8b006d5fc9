#pragma once
// Builds a progressive mesh from a whole welded mesh in memory: one simplification from end to end,
// every collapse recorded, then encoded. The measure for construction by diamonds.
//
// The output depends on the mesh alone. Memory: kBuildBytes a triangle; MemoryError if the budget
// has less. Time: about two microseconds a triangle on one core.

#include <functional>
#include <memory>

#include "base/budget.h"
#include "methods/pmesh/split_encoder.h"
#include "simplify/collapse_sink.h"

namespace pietra::pmesh {

inline constexpr size_t kBuildBytes = 800;

/// `mesh`: welded, without degenerate or doubled triangles, with normals, all positions multiples
/// of 2^lattice.shift; its edge classes are set here.
SplitForest buildInCore(Mesh mesh, const Lattice& lattice, Budget& budget,
                        BuildCounts* counts = nullptr);

/// encodeSplits() with all nodes in memory.
SplitForest encodeInMemory(const Collapses& collapses, const Lattice& lattice, TempSpace& space,
                           BuildCounts& counts);

/// The simplification alone: `sink` makes who is told in the recorder's place, and tells it.
void collapseInCore(Mesh mesh, const Lattice& lattice, Budget& budget,
                    const std::function<std::unique_ptr<CollapseSink>(Recorder& recorder)>& sink);

}  // namespace pietra::pmesh
