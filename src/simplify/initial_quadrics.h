#pragma once
// The quadrics that a simplification starts with.

#include "simplify/attributes.h"
#include "simplify/working_mesh.h"

namespace pietra {

/// Sets those of all vertices from the planes of their triangles, planes across the edges on
/// curves, and the gradients of attributes. Needs positions, faces and classes. Linear.
void buildQuadrics(WorkingMesh& mesh, VertexAttributes& attributes);

}  // namespace pietra
