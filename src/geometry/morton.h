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

/// Every third bit, from the lowest on: what was spread.
constexpr uint32_t gatherBits(uint64_t x) {
    x &= 0x1249249249249249ULL;
    x = (x | x >> 2) & 0x10c30c30c30c30c3ULL;
    x = (x | x >> 4) & 0x100f00f00f00f00fULL;
    x = (x | x >> 8) & 0x1f0000ff0000ffULL;
    x = (x | x >> 16) & 0x1f00000000ffffULL;
    return uint32_t((x | x >> 32) & 0x1fffff);
}

/// Of coordinates within [0, 2^21); of three bits the lowest is x's.
constexpr uint64_t mortonCode(const Vec3i& p) {
    return spreadBits(uint32_t(p.x)) | spreadBits(uint32_t(p.y)) << 1 |
           spreadBits(uint32_t(p.z)) << 2;
}
constexpr Vec3i mortonPoint(uint64_t code) {
    return {int32_t(gatherBits(code)), int32_t(gatherBits(code >> 1)),
            int32_t(gatherBits(code >> 2))};
}

}  // namespace pietra
