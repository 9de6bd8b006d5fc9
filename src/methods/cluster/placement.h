#pragma once
// Where the anchors of a layer are best: nearest to the planes of the super faces around them, in
// the mean (Garland and Heckbert 1997), instead of at vertices of the input, which lie to one side
// of a curved surface. Pure functions of the mesh.

#include <vector>

#include "geometry/bounds.h"
#include "methods/cluster/polygon_mesh.h"

namespace pietra::cluster {

struct MovedAnchor {
    uint32_t vertex;
    Vec3i from;
};

/// Moves vertices that lie within the cell, whose faces close around them, to such places within
/// `room`, at most half the way to the nearest vertex. Returns which moved, increasing; their names
/// stay. Linear.
std::vector<MovedAnchor> moveAnchors(PolygonMesh& mesh, const Box3i& room);

}  // namespace pietra::cluster
