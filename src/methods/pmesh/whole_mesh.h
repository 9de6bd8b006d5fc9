#pragma once
// A whole input as one welded mesh in memory, on the lattice: what an in-core build starts from.

#include <string>

#include "base/progress.h"
#include "extmem/spill.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"
#include "geometry/mesh.h"
#include "io/triangle_source.h"

namespace pietra::pmesh {

struct WholeMesh {
    Mesh mesh;  ///< welded; no degenerate or doubled triangles; normals by area; no edge classes
    Lattice lattice;
    Box3i bounds;                  ///< of all vertices, used or not, lattice units
    float quantisation_error = 0;  ///< of the lattice, lattice units
    uint64_t input_vertices = 0;
    uint64_t dropped_degenerate = 0, dropped_duplicate = 0;
};

/// Takes about 100 bytes a triangle of the space's budget while it works, MemoryError if they are
/// not there. Throws what reading throws.
WholeMesh readWholeMesh(TriangleSource& source, const std::string& input_name,
                        const PrecisionSetting& precision, TempSpace& space, Progress& progress);

}  // namespace pietra::pmesh
