#pragma once
// Which vertices stay when faces are merged (Wu and Huang 2014, section 3): anchors, where three
// super faces or more meet, or two and a border; those that other cells use; at least three for
// each super face. All chains between them become straight edges. To be a valid mesh of polygons,
// no two edges may have the same ends, and none but the input's own may join two vertices that
// other cells use: for these, the vertex of the chain that lies furthest off stays, too.
//
// A function of mesh and groups alone; n log n in the vertices of outlines.

#include <vector>

#include "methods/cluster/polygon_mesh.h"

namespace pietra::cluster {

/// One a vertex: 1 if it stays. The groups are discs with simple outlines.
std::vector<uint8_t> findAnchors(const PolygonMesh& mesh, const Groups& groups);

/// Of a group's outline, the vertex that lies farthest from the edge for which it was left out
/// stays, too. `start`: a separating half-edge of the group. False where all stay already.
bool keepFarthest(const PolygonMesh& mesh, const Groups& groups, uint32_t start,
                  std::vector<uint8_t>& keep);

}  // namespace pietra::cluster
