#pragma once
// Unit normals as two signed 16-bit numbers on the octahedron (Meyer et al. 2010). Exactly
// reproducible: add, multiply, divide and sqrt of float only. Worst error about 0.005 degrees.

#include <cmath>
#include <cstdint>

#include "geometry/vec.h"

namespace pietra {

struct OctNormal {
    int16_t x = 0;
    int16_t y = 0;
    bool operator==(const OctNormal&) const = default;
};

/// `n` need not be of unit length; a zero or non-finite vector becomes +z.
inline OctNormal encodeNormal(const Vec3f& n) {
    const float sum = std::abs(n.x) + std::abs(n.y) + std::abs(n.z);
    if (!(sum > 0) || !std::isfinite(sum)) return {};
    float x = n.x / sum, y = n.y / sum;
    if (n.z < 0) {
        const float folded_x = (1 - std::abs(y)) * (x < 0 ? -1.0f : 1.0f);
        y = (1 - std::abs(x)) * (y < 0 ? -1.0f : 1.0f);
        x = folded_x;
    }
    const auto quantise = [](float v) {
        v = v < -1 ? -1 : v > 1 ? 1 : v;
        const float scaled = v * 32767.0f;
        return int16_t(scaled < 0 ? scaled - 0.5f : scaled + 0.5f);
    };
    return {quantise(x), quantise(y)};
}

inline Vec3f decodeNormal(const OctNormal& o) {
    float x = float(o.x) / 32767.0f, y = float(o.y) / 32767.0f;
    const float z = 1 - std::abs(x) - std::abs(y);
    if (z < 0) {
        const float folded_x = (1 - std::abs(y)) * (x < 0 ? -1.0f : 1.0f);
        y = (1 - std::abs(x)) * (y < 0 ? -1.0f : 1.0f);
        x = folded_x;
    }
    const float length = std::sqrt(x * x + y * y + z * z);
    return {x / length, y / length, z / length};
}

}  // namespace pietra
