#pragma once
// The inner loops of the simplifier, many at a time, through Highway: where do edges collapse to
// and at what cost, which triangles might fold, and how far is a point from them. Equal results on
// every instruction set: elementwise IEEE operations in one order, no fused multiply-add.

#include <cstdint>

#include "simplify/attribute_rows.h"
#include "simplify/working_mesh.h"

namespace pietra {

/// Edges evaluated together: two vectors of AVX2, one of AVX-512.
inline constexpr uint32_t kBatch = 16;
/// Triangles tested together.
inline constexpr uint32_t kFoldBatch = 8;

/// Where new vertices may lie, relative to the mesh's centre.
struct SnapGrid {
    float step = 1, inverse_step = 1;
    Vec3f low{0, 0, 0}, high{0, 0, 0};
};

/// Edges to evaluate; fill all lanes (repeat one that is there).
struct alignas(64) EdgeBatch {
    uint32_t u[kBatch], v[kBatch];
    float cost[kBatch];                     ///< the quadrics' value at the place, >= 0
    float x[kBatch], y[kBatch], z[kBatch];  ///< on the grid; an end where only that may be
    /// Of the attributes in the quadrics, there.
    float value[kMaxQuadricAttributes][kBatch];
};

struct EdgeKernels {
    /// Minimum of both quadrics' sum, or the edge's middle where that is further than an edge away,
    /// rounded to the grid.
    void (*place)(const Point* points, const Quadric* quadrics, const AttributeView& attributes,
                  const SnapGrid& grid, EdgeBatch& batch);
    /// Triangles (apex, next, previous) of which the apex moves to `to`: a bit for each that turns
    /// too far or becomes a sliver. Reads eight of each array.
    uint32_t (*foldingTriangles)(const Point* points, const uint32_t* apex, const uint32_t* next,
                                 const uint32_t* previous, const Vec3f& to);
    /// Squared distance of `point` to the triangles (apex, next, previous), eight of each array.
    float (*fanDistanceSq)(const Point* points, const uint32_t* next, const uint32_t* previous,
                           const Vec3f& apex, const Vec3f& point);
};

/// For the processor at hand.
EdgeKernels chooseEdgeKernels();

/// Cosine of the largest turn of a triangle, squared.
inline constexpr float kMinCosineSq = 0.2f * 0.2f;
/// Least (twice the area)^2 / (longest edge)^4: a height of about 1/60 of the longest edge.
inline constexpr float kMinShape = 3e-4f;

}  // namespace pietra
