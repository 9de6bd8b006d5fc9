#pragma once
// What is drawn at once: patches with their screen vertices side by side, and a number for every
// triangle.

#include <cstddef>
#include <cstdint>
#include <vector>

#include "multires/draw_list.h"
#include "render/raster/projection.h"

namespace pietra {

/// Asks for memory all at once, where it will be read piece by piece in no order that the hardware
/// could foresee.
inline void prefetchBytes(const void* begin, size_t bytes) {
    constexpr size_t kCacheLine = 64;
    for (size_t i = 0; i < bytes; i += kCacheLine)
        __builtin_prefetch(static_cast<const char*>(begin) + i);
}

struct BatchPatch {
    const DrawPatch* patch = nullptr;
    uint32_t model = 0;              ///< in Batch::model
    ScreenVertex* vertex = nullptr;  ///< in Batch::vertex, as the mesh's positions
    uint32_t first_number = 0;       ///< of its triangles
    bool both_sides = true;
    bool whole = true;      ///< every vertex has an image
    PixelBox box;           ///< holds all its pixels
    float nearest = 0;      ///< no sample of it has a larger 1 / depth
    Vec3f colour{1, 1, 1};  ///< patchColour()
    const Mesh& mesh() const { return *patch->mesh; }
    const Triangle* triangle() const { return patch->mesh->triangle.data(); }
};

/// Consecutive triangles of one patch, drawn and shaded as a whole by each tile it touches.
struct DrawChunk {
    const BatchPatch* patch;
    uint32_t first, count;  ///< triangles of the patch
    PixelBox box;           ///< holds all its pixels
    float nearest;          ///< as of a patch
    uint32_t firstNumber() const { return patch->first_number + first; }
};

/// What its patches have in common.
struct BatchModel {
    View view;
    Projection projection;
};

struct Batch {
    std::vector<BatchModel> model;
    std::vector<BatchPatch> patch;
    std::vector<ScreenVertex> vertex;
    size_t triangles = 0, vertices = 0;  ///< of the patches
};

}  // namespace pietra
