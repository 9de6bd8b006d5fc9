#pragma once
// Four floats in one SSE register (x, y, z, unused), by the compilers' vector extension, which g++
// and clang share and which the base instruction set has: the decoder's inner loops are too short
// for a dispatch. One rounding an operation, so results are the same everywhere. Internal to
// src/store.

#include <cstdint>

#include "geometry/vec.h"

namespace pietra {

using Lanes = float __attribute__((vector_size(16)));
using LaneMask = int32_t __attribute__((vector_size(16)));  ///< of a comparison: 0 or -1

inline Lanes toLanes(const Vec3i& p) {
    return Lanes{float(p.x), float(p.y), float(p.z), 0};
}

inline Vec3i toVec3i(Lanes p) {
    return {int32_t(p[0]), int32_t(p[1]), int32_t(p[2])};
}

inline Lanes crossProduct(Lanes a, Lanes b) {
    const Lanes left = a * __builtin_shufflevector(b, b, 1, 2, 0, 3);
    const Lanes right = b * __builtin_shufflevector(a, a, 1, 2, 0, 3);
    const Lanes rotated = left - right;
    return __builtin_shufflevector(rotated, rotated, 1, 2, 0, 3);
}

/// To the nearest integer, for |x| < 2^22; beyond that to some integer near it.
inline int32_t roundToInt(float x) {
    constexpr float kMagic = 12582912.0f;  // 1.5 * 2^23: the sum has no fraction bits left
    return int32_t((x + kMagic) - kMagic);
}

}  // namespace pietra
