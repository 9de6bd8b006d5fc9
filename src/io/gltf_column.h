#pragma once
// Reads one accessor of a glTF file, element by element in order: any component type, normalised or
// not, packed or interleaved, with sparse replacements. Memory: a window of about kBlockBytes for a
// call (gltf_buffers.h), shared by columns that are interleaved.

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <string>

#include "io/gltf_buffers.h"
#include "io/gltf_document.h"

namespace pietra {

class GltfColumn {
public:
    /// Checks that the accessor and its sparse part lie within their views and buffers, and that
    /// these are there. `user`: what refers to it, for messages. The document and the buffers
    /// outlive the column.
    GltfColumn(const GltfDocument& document, GltfBuffers& buffers, uint32_t accessor,
               const std::string& user);

    uint64_t count() const { return accessor_->count; }
    int components() const { return accessor_->components; }
    const GltfAccessor& accessor() const { return *accessor_; }
    /// Bytes of a buffer from an element to the next.
    uint64_t stride() const { return base_.stride; }
    /// The number of the element read next.
    uint64_t row() const { return row_; }
    /// The next element will be number `row`.
    void seek(uint64_t row);
    /// How many elements a call may read.
    size_t blockRows() const {
        return size_t(std::clamp<uint64_t>(kBlockBytes / std::max<uint64_t>(base_.stride, 4), 1,
                                           kBlockBytes));
    }

    /// Writes the next `rows` elements (at most blockRows(), within count()) to out[0],
    /// out[out_stride], ...: the first `components` of each. T: double, float, uint8_t, uint64_t;
    /// normalised integers are divided if `normalize`.
    template <class T>
    void read(size_t rows, T* out, size_t out_stride, int components, bool normalize);

    /// "accessors[3], element 7 (byte 1234)"
    std::string placeOf(uint64_t row) const;

private:
    static constexpr uint64_t kBlockBytes = 1 << 18;
    /// Elements in a buffer.
    struct Range {
        uint32_t buffer = kGltfNone;
        uint64_t begin = 0;   ///< of the first element
        uint64_t stride = 0;  ///< from one to the next
        uint64_t bytes = 0;   ///< of one
        uint64_t view_begin = 0, view_end = 0;
    };
    Range resolve(const GltfDocument& document, uint32_t view, uint64_t offset, uint64_t count,
                  uint64_t element_bytes, const std::string& what);
    const uint8_t* bytesOf(const Range& range, uint64_t first, size_t rows);
    const uint8_t* sparseElement(const Range& range, uint64_t number);
    uint64_t sparseIndex(uint64_t number);

    std::string name_;  ///< "accessors[3]"
    GltfBuffers* buffers_;
    const GltfAccessor* accessor_;
    const GltfSparse* sparse_ = nullptr;
    Range base_;  ///< no buffer: zeros
    Range sparse_indices_, sparse_values_;
    uint64_t row_ = 0;
    uint64_t sparse_next_ = 0;
    uint64_t sparse_row_ = 0;  ///< the element that it replaces; count() after the last
};

}  // namespace pietra
