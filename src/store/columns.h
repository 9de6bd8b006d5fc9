#pragma once
// Columns of 32-bit numbers as byte planes: plane k is a stream that holds byte k of every number.
// As many planes are stored as the largest number needs; a column of zeros takes none. Internal to
// src/store.

#include <array>
#include <bit>

#include "store/page_format.h"

namespace pietra {

/// The planes that the numbers below need, 0 to 4; `any` is their bitwise or.
inline int planesFor(uint32_t any) {
    return (32 - std::countl_zero(any) + 7) / 8;
}

/// Adds the planes of `column` to the packer and their number to `plane_counts`.
inline void packColumn(std::span<const uint32_t> column, StreamPacker& packer,
                       std::vector<uint8_t>& plane_counts) {
    uint32_t any = 0;
    for (const uint32_t value : column) any |= value;
    const int planes = planesFor(any);
    plane_counts.push_back(uint8_t(planes));
    for (int plane = 0; plane < planes; ++plane) {
        std::vector<uint8_t>& stream = packer.add();
        stream.resize(column.size());
        for (size_t i = 0; i < column.size(); ++i) stream[i] = uint8_t(column[i] >> (8 * plane));
    }
}

/// Numbers begin to begin + column.size() of the column whose `planes` planes start at stream
/// `first`. The streams must be long enough.
inline void unpackColumn(const StreamUnpacker& streams, size_t first, int planes, size_t begin,
                         std::span<uint32_t> column) {
    std::array<const uint8_t*, 4> plane{};
    for (int k = 0; k < planes; ++k) plane[k] = streams[first + k].data() + begin;
    const size_t n = column.size();
    uint32_t* out = column.data();
    switch (planes) {
        case 0:
            for (size_t i = 0; i < n; ++i) out[i] = 0;
            break;
        case 1:
            for (size_t i = 0; i < n; ++i) out[i] = plane[0][i];
            break;
        case 2:
            for (size_t i = 0; i < n; ++i) out[i] = uint32_t(plane[0][i] | plane[1][i] << 8);
            break;
        case 3:
            for (size_t i = 0; i < n; ++i)
                out[i] = uint32_t(plane[0][i] | plane[1][i] << 8 | plane[2][i] << 16);
            break;
        default:
            for (size_t i = 0; i < n; ++i)
                out[i] = plane[0][i] | uint32_t(plane[1][i]) << 8 | uint32_t(plane[2][i]) << 16 |
                         uint32_t(plane[3][i]) << 24;
    }
}

}  // namespace pietra
