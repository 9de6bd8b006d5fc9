#pragma once
// The octree partition of Wu and Huang 2014, section 5.1, but for the paper's second and third
// rule. Vertices lie in a cell; a triangle belongs to the last of the cells of its vertices. The
// paper's majority makes zigzags, as a row of triangles between two cells is shared out by turns:
// twice as long interfaces, of which no vertex may leave before its triangle does. In memory.

#include <vector>

#include "geometry/mesh.h"

namespace pietra::cluster {

struct CellTriangles {
    std::vector<std::vector<uint32_t>> of_cell;  ///< triangles, along a space-filling curve
};

/// Cells are divided until they hold at most `most_vertices`. Empty ones are left out; the order is
/// that of the curve.
CellTriangles octreeCells(const Mesh& mesh, uint32_t most_vertices);

}  // namespace pietra::cluster
