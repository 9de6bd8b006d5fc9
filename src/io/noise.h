#pragma once
// Sine, cosine and value noise that give the same bits on every machine: additions, multiplications
// and floor of doubles, and a hash of integers.

#include <cmath>
#include <cstdint>

#include "base/hash.h"
#include "geometry/vec.h"

namespace pietra {

struct SinCos {
    double sin;
    double cos;
};

/// Sine and cosine of t quarter turns, 0 <= t <= 1, to about 1e-16; exact at 0 and 1. Taylor's
/// series up to the eighth of a turn, mirrored beyond.
inline SinCos quarterTurn(double t) {
    const bool mirrored = t > 0.5;
    const double x = (mirrored ? 1 - t : t) * 1.5707963267948966;
    const double q = x * x;
    // Horner: 1 - q/2 (1 - q/12 (1 - ...)), and the same for sin(x)/x.
    double sine = 1, cosine = 1;
    for (int k = 20; k >= 2; k -= 2) {
        cosine = 1 - cosine * (q / double(k * (k - 1)));
        sine = 1 - sine * (q / double(k * (k + 1)));
    }
    sine *= x;
    return mirrored ? SinCos{cosine, sine} : SinCos{sine, cosine};
}

/// A number in [-1, 1) for every point of the integer lattice.
inline double latticeNoise(int64_t x, int64_t y, int64_t z, uint64_t seed) {
    const uint64_t key = uint64_t(x) * 0x9e3779b97f4a7c15ULL ^ uint64_t(y) * 0xc2b2ae3d27d4eb4fULL ^
                         uint64_t(z) * 0x165667b19e3779f9ULL ^ seed;
    return double(int64_t(mixBits(key)) >> 11) * 0x1p-52;
}

namespace detail {
inline double smooth(double t) {
    return t * t * t * (t * (t * 6 - 15) + 10);
}
inline double mix(double a, double b, double t) {
    return a + (b - a) * t;
}
}  // namespace detail

/// Smooth noise in [-1, 1]: lattice values, interpolated with continuous second derivatives.
inline double valueNoise(const Vec3d& p, uint64_t seed) {
    const double fx = std::floor(p.x), fy = std::floor(p.y), fz = std::floor(p.z);
    const auto x = int64_t(fx), y = int64_t(fy), z = int64_t(fz);
    const double u = detail::smooth(p.x - fx), v = detail::smooth(p.y - fy),
                 w = detail::smooth(p.z - fz);
    double layer[2];
    for (int k = 0; k < 2; ++k)
        layer[k] = detail::mix(
            detail::mix(latticeNoise(x, y, z + k, seed), latticeNoise(x + 1, y, z + k, seed), u),
            detail::mix(latticeNoise(x, y + 1, z + k, seed),
                        latticeNoise(x + 1, y + 1, z + k, seed), u),
            v);
    return detail::mix(layer[0], layer[1], w);
}

/// The same in the plane.
inline double valueNoise(double px, double py, uint64_t seed) {
    const double fx = std::floor(px), fy = std::floor(py);
    const auto x = int64_t(fx), y = int64_t(fy);
    const double u = detail::smooth(px - fx), v = detail::smooth(py - fy);
    return detail::mix(
        detail::mix(latticeNoise(x, y, 0, seed), latticeNoise(x + 1, y, 0, seed), u),
        detail::mix(latticeNoise(x, y + 1, 0, seed), latticeNoise(x + 1, y + 1, 0, seed), u), v);
}

}  // namespace pietra
