#pragma once
// The part of attributes.h that the kernels see.

#include <cstdint>

namespace pietra {

/// At most so many attributes have a part in the quadrics: three of the colour, then scalars.
inline constexpr uint32_t kMaxQuadricAttributes = 8;

struct alignas(16) AttributeRow {
    float gx = 0, gy = 0, gz = 0, d = 0;
};

/// What the kernels see: `count` rows a vertex, and values in groups of four, as wide as lengths.
struct AttributeView {
    const AttributeRow* row = nullptr;
    const float* value = nullptr;
    uint32_t count = 0;
    uint32_t value_stride = 0;  ///< floats a vertex, a multiple of four
};

}  // namespace pietra
