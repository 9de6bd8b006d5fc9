#pragma once
// Four floats in a register, for code that is too branchy for wider vectors. Written with the
// vector extension of g++ and clang, not with Highway: it needs four lanes on the plain baseline,
// where Highway 1.0 has only its scalar target, and no dispatch. Plain IEEE operations: the same
// bits everywhere.
//
// Points of space sit in lanes 1 to 3; lane 0 is free for a number that goes with them.

#include <array>
#include <cstdint>
#include <cstring>
#ifdef __SSE2__
#include <emmintrin.h>
#endif

namespace pietra {

using Lanes4 = float __attribute__((vector_size(16)));
using IntLanes4 = int32_t __attribute__((vector_size(16)));

inline Lanes4 loadLanes(const float* aligned) {
    Lanes4 v;
    std::memcpy(&v, __builtin_assume_aligned(aligned, 16), sizeof v);
    return v;
}

/// Lanes 0, 2, 3, 1.
inline Lanes4 rotate(Lanes4 v) {
    return __builtin_shufflevector(v, v, 0, 2, 3, 1);
}

template <int kLane>
inline Lanes4 broadcast(Lanes4 v) {
    return __builtin_shufflevector(v, v, kLane, kLane, kLane, kLane);
}

/// The larger of each lane; b where a is not a number.
inline Lanes4 maxLanes(Lanes4 a, Lanes4 b) {
#ifdef __SSE2__
    return _mm_max_ps(a, b);
#else
    return Lanes4{a[0] > b[0] ? a[0] : b[0], a[1] > b[1] ? a[1] : b[1], a[2] > b[2] ? a[2] : b[2],
                  a[3] > b[3] ? a[3] : b[3]};
#endif
}

inline Lanes4 absLanes(Lanes4 v) {
    return Lanes4(IntLanes4(v) & 0x7fffffff);
}

/// v where `mask` is all ones, zero where it is zero.
inline Lanes4 maskLanes(IntLanes4 mask, Lanes4 v) {
    return Lanes4(mask & IntLanes4(v));
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

/// Bit i: the i-th of four numbers is `x`. They need not be aligned.
inline uint32_t equalLanes(const uint32_t* numbers, uint32_t x) {
    IntLanes4 v;
    std::memcpy(&v, numbers, sizeof v);
    return signBits(Lanes4(v == int32_t(x)));
}

/// The largest of lanes 1, 2, 3, in lane 1.
inline Lanes4 maxOfPoint(Lanes4 v) {
    const Lanes4 once = rotate(v);
    return maxLanes(maxLanes(v, once), rotate(once));
}

/// Lane 0: the largest of lanes 1, 2, 3 of a; lane 1: of b.
inline Lanes4 maxOfPoints(Lanes4 a, Lanes4 b) {
    const Lanes4 last = __builtin_shufflevector(a, b, 2, 6, 3, 7);
    const Lanes4 most = maxLanes(last, __builtin_shufflevector(a, b, 1, 5, 1, 5));
    return maxLanes(most, __builtin_shufflevector(most, most, 2, 3, 2, 3));
}

/// Lanes 1 + 2 + 3, in lane 1.
inline Lanes4 sumOfPoint(Lanes4 v) {
    const Lanes4 once = rotate(v);
    return v + once + rotate(once);
}

/// The cross product of two points; lane 0 becomes zero if both are finite.
inline Lanes4 crossPoints(Lanes4 a, Lanes4 b) {
    return rotate(a * rotate(b) - rotate(a) * b);
}

inline void transpose(Lanes4& a, Lanes4& b, Lanes4& c, Lanes4& d) {
#ifdef __SSE2__
    _MM_TRANSPOSE4_PS(reinterpret_cast<__m128&>(a), reinterpret_cast<__m128&>(b),
                      reinterpret_cast<__m128&>(c), reinterpret_cast<__m128&>(d));
#else
    const Lanes4 p = a, q = b, r = c, s = d;
    a = Lanes4{p[0], q[0], r[0], s[0]};
    b = Lanes4{p[1], q[1], r[1], s[1]};
    c = Lanes4{p[2], q[2], r[2], s[2]};
    d = Lanes4{p[3], q[3], r[3], s[3]};
#endif
}

}  // namespace pietra
