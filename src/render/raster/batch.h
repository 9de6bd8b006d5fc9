#pragma once
// What one call of draw() works on: patches with their screen vertices side by side, and a number
// for every triangle, from which patch and triangle are found again.

#include <cstdint>
#include <vector>

#include "render/draw_list.h"
#include "render/raster/projection.h"

namespace pietra {

/// Each patch's triangle numbers begin at a multiple of this, so that a table of one entry a block
/// finds the patch.
inline constexpr int kNumberBlockBits = 8;

struct BatchPatch {
    const DrawPatch* patch = nullptr;
    bool both_sides = true;
    uint32_t first_vertex = 0;  ///< in Batch::vertex
    uint32_t first_number = 0;  ///< of its triangles
    PixelBox box;               ///< holds all its samples
    bool whole = true;          ///< every vertex has an image
    Vec3f colour{1, 1, 1};      ///< patchColour()
};

struct Batch {
    std::vector<BatchPatch> patch;
    std::vector<ScreenVertex> vertex;
    std::vector<uint32_t> patch_of_block;  ///< by triangle number >> kNumberBlockBits

    const BatchPatch& patchOf(uint32_t number) const {
        return patch[patch_of_block[number >> kNumberBlockBits]];
    }
};

}  // namespace pietra
