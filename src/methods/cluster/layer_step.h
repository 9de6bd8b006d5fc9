#pragma once
// One step of one cell: from a layer to the next (Wu and Huang 2014, section 3): vertices leave the
// interfaces, faces are clustered to super faces, these triangulated, and what that costs in
// distance is bounded. Nothing here knows of other cells: a construction in memory and one out of
// core call the same. Pure functions.

#include <span>
#include <vector>

#include "methods/cluster/face_clusters.h"
#include "methods/cluster/placement.h"
#include "methods/cluster/triangulation.h"
#include "simplify/deviation.h"

namespace pietra::cluster {

struct LayerStep {
    PolygonMesh polygons;
    /// Those of `to_free` have still to be moved to free points, before anything is bounded.
    LayerTriangles triangles;
    /// Vertices of both meshes that were moved to where others might lie (FreePoints::settle).
    std::vector<MovedAnchor> moved;
    /// One a triangle of the layer below: where to look for what became of it.
    std::vector<uint32_t> triangle_map;
};

/// `below_triangles` are those of `below`. `removed`: one a vertex of the model, by its name.
/// `faces_each`: faces of `below` in one of the result, about. `room`: where vertices may be moved.
LayerStep nextLayer(const PolygonMesh& below, const LayerTriangles& below_triangles,
                    std::span<const uint8_t> removed, uint32_t faces_each, const Box3i& room,
                    const ClusterSettings& settings);

/// A cell's strips of one step, as meshes of their own. Where a vertex leaves, one of the two cells
/// loses the strip's triangle and the other gains it, but for folds: it does not matter which is
/// taken for which as long as it is one of each. What the one *gives* the other *takes*.
struct StripsOfCell {
    Mesh given;  ///< as they follow in this cell's outline: before, removed, after
    Mesh taken;  ///< the other way round
    /// Of each taken strip: an upper bound of its distance to layer 0.
    std::vector<float> taken_bound;
};

/// Of a layer above `below`: an upper bound of its distance to layer 0, both ways, at least
/// `error`, that of `below`. `bounds`: of the triangles of `below`, then of the layer's. With
/// strips, what is near those given is theirs: `given_bound` becomes a bound of its distance from
/// each, negative where nothing is. What the cell takes is missing in its bounds until
/// takeStrips().
float boundLayer(const Mesh& below, float error, const Mesh& layer,
                 std::span<const uint32_t> triangle_map, Deviation& deviation, FaceBounds& bounds);
float boundLayer(const Mesh& below, float error, const Mesh& layer,
                 std::span<const uint32_t> triangle_map, const StripsOfCell& strips,
                 Deviation& deviation, FaceBounds& bounds, std::vector<float>& given_bound);

/// The cell's layer stands from now on for what the other cells gave to the strips that it takes,
/// `given_bound` of each. Returns the layer's bound, at least `error`, the one before.
float takeStrips(const Mesh& taken, std::span<const float> given_bound, const Mesh& layer,
                 float error, FaceBounds& bounds);

/// Upper bounds of the distance to layer 0 of each triangle of `strips`, by what is known of those
/// of `below` that have a vertex in common with one of them: some must.
std::vector<float> boundStrips(const Mesh& strips, const Mesh& below, float error,
                               const FaceBounds& bounds);

}  // namespace pietra::cluster
