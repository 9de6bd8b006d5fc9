#pragma once
// One step of one cell: from a layer to the next (Wu and Huang 2014, section 3): vertices leave the
// interfaces, faces are clustered to super faces, these triangulated, and what that costs in
// distance is bounded. Nothing here knows of other cells: a construction in memory and one out of
// core call the same. Pure functions.

#include <span>
#include <vector>

#include "methods/cluster/face_clusters.h"
#include "methods/cluster/triangulation.h"
#include "simplify/deviation.h"

namespace pietra::cluster {

struct LayerStep {
    PolygonMesh polygons;
    /// Those of `to_free` have still to be moved to free points, before anything is bounded.
    LayerTriangles triangles;
    /// One a triangle of the layer below: where to look for what became of it.
    std::vector<uint32_t> triangle_map;
};

/// `below_triangles` are those of `below`. `removed`: one a vertex of the model, by its name.
/// `faces_each`: faces of `below` in one of the result, about.
LayerStep nextLayer(const PolygonMesh& below, const LayerTriangles& below_triangles,
                    std::span<const uint8_t> removed, uint32_t faces_each,
                    const ClusterSettings& settings);

/// Of a layer above `below`: an upper bound of its distance to layer 0, both ways, at least
/// `error`, that of `below`. `bounds`: of the triangles of `below`, then of the layer's.
float boundLayer(const Mesh& below, float error, const Mesh& layer,
                 std::span<const uint32_t> triangle_map, Deviation& deviation, FaceBounds& bounds);

/// Upper bounds of the distance to layer 0 of each triangle of `strips`, by what is known of
/// `below`.
std::vector<float> boundStrips(const Mesh& strips, const Mesh& below, float error,
                               const FaceBounds& bounds);

}  // namespace pietra::cluster
