#pragma once
// All layers of one piece in memory: octree cells, each with its layers, and the strips between
// them. Any choice of one layer a cell, with the strips that it asks for, is one mesh without
// cracks; mixedMesh() puts it together.

#include <cstdint>
#include <span>
#include <vector>

#include "methods/cluster/face_clusters.h"
#include "methods/cluster/interfaces.h"
#include "methods/cluster/triangulation.h"

namespace pietra::cluster {

struct LayerSettings {
    uint32_t cell_vertices = 8192;  ///< most in an octree cell
    uint16_t layers = 6;            ///< above the input's triangles
    uint32_t first_faces = 12;      ///< triangles in a super face of layer 1
    uint32_t faces = 3;             ///< super faces of a layer in one of the next
    ClusterSettings clustering;
};

struct CellLayers {
    std::vector<LayerTriangles> layer;  ///< layer 0 first
    /// Of each layer and its strips to finer ones: a bound of the distance to layer 0, both ways,
    /// in lattice units (docs/design/error.md). Never decreases.
    std::vector<float> error;
};

struct LayeredPiece {
    std::vector<Vec3i> position;  ///< of the model's vertices: strips name them
    std::vector<CellLayers> cell;
    std::vector<Strip> strips;  ///< by layer
    uint16_t layers = 0;        ///< above layer 0
    struct {
        double cells = 0, interfaces = 0, faces = 0, errors = 0;
    } seconds;  ///< of the stages
};

/// `mesh` is the whole model, with edge classes, welded. Any partition will do.
LayeredPiece buildLayers(const Mesh& mesh, const CellTriangles& cells,
                         const LayerSettings& settings);
/// With octree cells.
LayeredPiece buildLayers(const Mesh& mesh, const LayerSettings& settings);

/// A layer for each cell. Vertices are not shared between cells; there are no normals.
Mesh mixedMesh(const LayeredPiece& piece, std::span<const uint16_t> layer_of_cell,
               bool with_strips = true);

}  // namespace pietra::cluster
