#pragma once
// The triangles of a layer: every polygon by itself, so that the whole stays a valid mesh. No
// diagonal may join two vertices that are joined already in this cell, nor two that other cells
// use, which might join them. Of the diagonals left, ears are cut where they look the polygon's way
// and have the best shape. Where every one is refused, or some fold over and a star does not, the
// polygon becomes a star around a point that nobody else uses: a vertex of the input within the
// face, or else a free point of the lattice.

#include "methods/cluster/polygon_mesh.h"

namespace pietra::cluster {

struct LayerTriangles {
    Mesh mesh;                   ///< edge classes, no normals; the polygons' vertices, then others
    std::vector<uint32_t> face;  ///< of each triangle: the polygon
    uint32_t stars = 0;
    std::vector<uint32_t> folded;  ///< polygons with triangles that look away from them
    /// Vertices of `mesh` that lie where a free point of the lattice would be best, and are to be
    /// moved to one.
    std::vector<uint32_t> to_free;
};

LayerTriangles triangulate(const PolygonMesh& polygons);

}  // namespace pietra::cluster
