#pragma once
// What every cut of an adaptive model must have in common with its coarsest: a split or a collapse
// changes none of it. A crack or an overlap would.

#include <cstdint>

#include "geometry/mesh.h"

namespace pietra {

struct MeshTopology {
    int64_t euler = 0;             ///< vertices that triangles use - edges + triangles
    uint64_t borders = 0;          ///< connected sets of edges used once
    uint64_t irregular_edges = 0;  ///< used more than twice, or twice in one direction
    uint64_t degenerate = 0;       ///< triangles with two corners at one vertex
    bool operator==(const MeshTopology&) const = default;
};

/// By vertices' indices, not places. n log n; about 80 bytes a triangle.
MeshTopology topologyOf(const Mesh& mesh);

}  // namespace pietra
