#pragma once
// Crumbs: leaves whose diamonds hold next to nothing. They arise where a cell takes little of the
// surface, or only the barycentres of long triangles that belong elsewhere. All vertices of such a
// diamond are locked: it stays as exact as it is, and still has to state the errors of its
// neighbours. So its triangles go to leaves across their edges.
//
// Any leaf may hold any triangle: diamonds lock the edges that others use, not what lies on the
// faces of cells, so cuts remain free of cracks; and bounds come from what a leaf holds.
//
// Deterministic. Reads all leaves once more for each 2^18 triangles of crumbs; memory: about 100
// bytes for each of these, and some 50 a split cell.

#include "coarsen/leaves.h"

namespace pietra {

/// Moves the triangles of leaves that lie in a diamond with fewer than `least`, or below one, to
/// other leaves that share an edge with them, or with such as are on their way there. What hangs
/// together with nothing larger stays.
void moveCrumbs(Leaves& leaves, CellStore& store, uint32_t least, Progress& progress);

}  // namespace pietra
