#pragma once
// Which vertices may move: decided by how often each edge is used here, compared with how often its
// class says it is used in the whole model.

#include <cstdint>

#include "simplify/working_mesh.h"

namespace pietra {

/// Sets rank and outer flag of every vertex; needs fans, faces and classes. Returns the number of
/// outer vertices. Linear, but for vertices on curves with many corners (n log n in these).
///
/// Outer (and so fixed): the ends of edges used not as often as their class says, of class kMany,
/// or with triangles that disagree on the class. Curve: exactly two edges of class kBorder, or
/// exactly two of kTriple, and none else but kManifold. Fixed: any other with such edges.
uint32_t classifyVertices(WorkingMesh& mesh);

}  // namespace pietra
