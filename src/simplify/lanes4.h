#pragma once
// Four floats in a register, for code that is too branchy for wider vectors. Written with the
// vector extension of g++ and clang, not with Highway: it needs four lanes on the plain baseline,
// where Highway 1.0 has only its scalar target, and no dispatch. Plain IEEE operations: the same
// bits everywhere.

#include <array>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace pietra {

using Lanes4 = float __attribute__((vector_size(16)));

inline Lanes4 loadLanes(const float* aligned) {
    Lanes4 v;
    std::memcpy(&v, __builtin_assume_aligned(aligned, 16), sizeof v);
    return v;
}

inline void storeLanes(Lanes4 v, float* aligned) {
    std::memcpy(__builtin_assume_aligned(aligned, 16), &v, sizeof v);
}

inline Lanes4 maxLanes(Lanes4 a, Lanes4 b) {
#ifdef __SSE2__
    return _mm_max_ps(a, b);
#else
    return a > b ? a : b;
#endif
}

inline Lanes4 absLanes(Lanes4 v) {
    return maxLanes(v, -v);
}

/// Bit i: the sign bit of lane i is set (so -0 counts as negative).
inline uint32_t signBits(Lanes4 v) {
#ifdef __SSE2__
    return uint32_t(_mm_movemask_ps(v));
#else
    std::array<uint32_t, 4> bits;
    std::memcpy(&bits, &v, sizeof v);
    return bits[0] >> 31 | bits[1] >> 31 << 1 | bits[2] >> 31 << 2 | bits[3] >> 31 << 3;
#endif
}

}  // namespace pietra
