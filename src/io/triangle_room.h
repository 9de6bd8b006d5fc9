#pragma once
// What readers of formats fill batches of triangles with.

#include <array>
#include <cstddef>
#include <cstdint>

namespace pietra {

/// Where triangles are put: room for a batch, filled from the front. (A vector would be cleared
/// before each batch only to be overwritten, which costs as much as the decoding.)
struct TriangleRoom {
    std::array<uint64_t, 3>* data = nullptr;
    size_t capacity = 0;
    size_t size = 0;
    size_t left() const { return capacity - size; }
    void add(uint64_t a, uint64_t b, uint64_t c) { data[size++] = {a, b, c}; }
};

}  // namespace pietra
