#pragma once
// The two loops over the samples of a row that are neither rasterising nor shading, as many at a
// time as a SIMD register has lanes; the same results for any number of them.

#include <cstddef>

#include "render/raster/coverage.h"
#include "render/raster/pixel_shader.h"

namespace pietra {

/// Consecutive numbers of triangles, of one patch.
struct TriangleNumbers {
    uint32_t first_number;  ///< of all that is drawn at once
    uint32_t first;         ///< of the patch
    uint32_t count;
};

/// Marks those of `count` single samples that show one of the triangles as resolved, and appends an
/// item for each, the first sample's being at `place`. Returns where the items end; there must be
/// room for `count` and kCollectSlack more.
inline constexpr size_t kCollectSlack = 8;
ShadeItem* collectItems(VisibilityKey* key, size_t count, const TriangleNumbers& triangles,
                        ShadeItem place, ShadeItem* items);

/// Depths of `count` single samples, infinite where nothing is; and where something is, the colour
/// of `from` instead of that of `to`. Returns how many these are.
size_t finishSamples(const VisibilityKey* key, const Rgba8* from, size_t count, Rgba8* to,
                     float* depth);

}  // namespace pietra
