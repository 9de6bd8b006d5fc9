#pragma once
// Small triangles into the visibility buffer, as many at a time as a SIMD register has lanes: most
// cover at most 2 x 2 pixels, which are tried for all lanes at once. The samples covered and the
// depths there are those of drawTriangle(), bit for bit.

#include <cstdint>
#include <vector>

#include "geometry/mesh.h"
#include "render/raster/coverage.h"
#include "render/raster/projection.h"

namespace pietra {

/// Consecutive triangles of one patch.
struct TriangleRun {
    const Triangle* triangle;
    size_t count;
    uint32_t first_number;
    const ScreenVertex* vertex;  ///< what the indices count from
    bool both_sides;
};

/// Draws the triangles of a run whose three corners have images. The others' positions in the run
/// are appended to `clipped`, but for those wholly behind the eye.
void drawTriangles(const VisibilityTile& tile, const TriangleRun& run,
                   std::vector<uint32_t>& clipped);

}  // namespace pietra
