#pragma once
// Chooses the sub-lattice of a model for `--precision auto`: the coarsest one whose quantisation
// error stays under 1/50 of the median edge and on which no triangle loses a corner that is none on
// the finest lattice. One pass over the triangles, exact, whatever their order.

#include "base/progress.h"
#include "coarsen/vertex_table.h"
#include "io/triangle_source.h"

namespace pietra {

/// The shift to use. `batch_triangles`: how many are gathered at a time.
int chooseShift(TriangleSource& source, const VertexTable& vertices, size_t batch_triangles,
                Progress& progress);

}  // namespace pietra
