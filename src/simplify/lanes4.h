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
using IntLanes4 = int32_t __attribute__((vector_size(16)));

inline Lanes4 loadLanes(const float* aligned) {
    Lanes4 v;
    std::memcpy(&v, __builtin_assume_aligned(aligned, 16), sizeof v);
    return v;
}

/// Lanes 1, 2, 0, 3.
inline Lanes4 rotate3(Lanes4 v) {
#ifdef __SSE2__
    return _mm_shuffle_ps(v, v, _MM_SHUFFLE(3, 0, 2, 1));
#else
    return Lanes4{v[1], v[2], v[0], v[3]};
#endif
}

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

/// The largest of lanes 0, 1, 2.
inline float maxOf3(Lanes4 v) {
    const Lanes4 once = rotate3(v);
    return maxLanes(maxLanes(v, once), rotate3(once))[0];
}

/// Lanes 0 + 1 + 2.
inline float sumOf3(Lanes4 v) {
    const Lanes4 once = rotate3(v);
    return (v + once + rotate3(once))[0];
}

/// The cross product of lanes 0 to 2; lane 3 becomes zero if both are finite.
inline Lanes4 cross3(Lanes4 a, Lanes4 b) {
    return rotate3(a * rotate3(b) - rotate3(a) * b);
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
