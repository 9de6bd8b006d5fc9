#pragma once
// One layer of one octree cell as it is passed on to the next: polygons, their triangles with all
// that vertices carry, and the bounds. Vertices of the polygons come first in the triangles' mesh
// and have their numbers as names; those within faces are named after them.

#include <array>
#include <span>
#include <vector>

#include "coarsen/cell_store.h"
#include "methods/cluster/interface_table.h"
#include "methods/cluster/triangulation.h"

namespace pietra::cluster {

struct CellLayer {
    PolygonMesh polygons;
    LayerTriangles triangles;
    Mesh inner;  ///< no triangles: the polygons' inner vertices
    FaceBounds bounds;
    /// Vertices of interfaces that an edge of the input joins: by number in the table, sorted, the
    /// lower first.
    std::vector<std::array<uint32_t, 2>> joined;
    float error = 0;
    bool closed = false;  ///< all triangles belong to closed, consistently oriented components
};

/// Of an input leaf.
CellLayer firstLayer(const CellMesh& leaf, float error, CellId cell, const Octree& octree,
                     const InterfaceTable& table);

/// The same, of nothing but the triangles at vertices that other cells use, their polygons and
/// `joined`: all that these cells are told.
CellLayer interfacesOfLeaf(const CellMesh& leaf, CellId cell, const Octree& octree,
                           const InterfaceTable& table);

/// What a cell's next layer begins with: the layers of its children, or its own. What no other cell
/// uses in `layer`, the next one, is no interface any more.
CellLayer joinLayers(std::span<const CellLayer> below, int layer, const InterfaceTable& table);
/// The same of one, which becomes it.
void continueLayer(CellLayer& cell, int layer, const InterfaceTable& table);

/// The polygons of the next layer and their triangles, named for `below`, get names of their own
/// and what vertices carry. Bounds, error and `joined` are not set.
CellLayer carryOver(const CellLayer& below, PolygonMesh polygons, LayerTriangles triangles);

/// As in memory, and back.
std::vector<std::byte> packLayer(const CellLayer& layer);
CellLayer unpackLayer(std::vector<std::byte> bytes);

/// Appends vertex `v` of `from` with all that it carries.
void appendVertex(const Mesh& from, uint32_t v, Mesh& to);

}  // namespace pietra::cluster
