#pragma once
// The Morton order: points along a curve through the cells of an octree.

#include <cstdint>

#include "geometry/vec.h"

namespace pietra {

/// Bits of a 21-bit number, two apart.
constexpr uint64_t spreadBits(uint64_t x) {
    x = (x | x << 32) & 0x1f00000000ffffULL;
    x = (x | x << 16) & 0x1f0000ff0000ffULL;
    x = (x | x << 8) & 0x100f00f00f00f00fULL;
    x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
    return (x | x << 2) & 0x1249249249249249ULL;
}

/// Of coordinates within [0, 2^21); of three bits the lowest is x's.
constexpr uint64_t mortonCode(const Vec3i& p) {
    return spreadBits(uint32_t(p.x)) | spreadBits(uint32_t(p.y)) << 1 |
           spreadBits(uint32_t(p.z)) << 2;
}

}  // namespace pietra
