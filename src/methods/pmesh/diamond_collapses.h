#pragma once
// The collapses of a whole model, found diamond by diamond by the coarsening engine: construction
// of progressive meshes without ever having the whole mesh in memory, on all cores.
//
// Between diamonds a vertex carries the key of its place in the input, which no other has, the
// record of its last collapse, that one's height and its error. Vertices on the outer
// border of a diamond take part in no collapse there: their stars lie in several. So all that
// orders collapses, the heights around, is known where it is needed.
//
// Records are counted in the order of the diamonds, from fine to coarse: the result does
// not depend on threads.

#include "construction/construction.h"
#include "methods/pmesh/collapses.h"

namespace pietra::pmesh {

/// Consumes the leaves; `out` is empty. Goes on from the last finished level where the construction
/// resumes. Memory: the diamonds at work, and some tens of bytes a cell.
void collapseByDiamonds(Construction& work, const BuildSettings& settings, Progress& progress,
                        Collapses& out);

}  // namespace pietra::pmesh
