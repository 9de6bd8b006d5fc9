#include "io/gltf_column.h"

#include <fmt/format.h>

#include <cstring>
#include <limits>

#include "base/check.h"
#include "base/error.h"

namespace pietra {

namespace {

template <class In, class Out, bool Normalize>
void decodeRows(const uint8_t* in, uint64_t stride, size_t rows, int components, Out* out,
                size_t out_stride) {
    for (size_t i = 0; i < rows; ++i, in += stride, out += out_stride) {
        for (int k = 0; k < components; ++k) {
            In value;
            std::memcpy(&value, in + size_t(k) * sizeof value, sizeof value);
            if constexpr (Normalize)
                out[k] = std::max(Out(value) / Out(std::numeric_limits<In>::max()), Out(-1));
            else
                out[k] = Out(value);
        }
    }
}

template <class In, class Out>
void decodeAs(const uint8_t* in, uint64_t stride, size_t rows, int components, bool normalize,
              Out* out, size_t out_stride) {
    if constexpr (std::is_integral_v<In> && std::is_floating_point_v<Out>)
        if (normalize)
            return decodeRows<In, Out, true>(in, stride, rows, components, out, out_stride);
    decodeRows<In, Out, false>(in, stride, rows, components, out, out_stride);
}

template <class Out>
void decode(GltfComponent type, const uint8_t* in, uint64_t stride, size_t rows, int components,
            bool normalize, Out* out, size_t out_stride) {
    const auto as = [&](auto value) {
        decodeAs<decltype(value)>(in, stride, rows, components, normalize, out, out_stride);
    };
    switch (type) {
        case GltfComponent::kInt8:
            return as(int8_t{});
        case GltfComponent::kUint8:
            return as(uint8_t{});
        case GltfComponent::kInt16:
            return as(int16_t{});
        case GltfComponent::kUint16:
            return as(uint16_t{});
        case GltfComponent::kUint32:
            return as(uint32_t{});
        case GltfComponent::kFloat:
            // note: a float need not fit an integer; callers that want integers ask for none.
            if constexpr (std::is_floating_point_v<Out>) return as(float{});
            CHECK(false);
    }
}

}  // namespace

GltfColumn::GltfColumn(const GltfDocument& document, GltfBuffers& buffers, uint32_t accessor,
                       const std::string& user)
    : name_(fmt::format("accessors[{}]", accessor)), buffers_(&buffers) {
    if (accessor >= document.accessors.size())
        throw InputError(buffers.path(), user,
                         fmt::format("there is no accessor {}: there are {}", accessor,
                                     document.accessors.size()));
    accessor_ = &document.accessors[accessor];
    const GltfAccessor& a = *accessor_;
    if (a.components == 0) throw InputError(buffers.path(), name_ + ".type", "is a matrix");
    const uint64_t bytes = a.components * pietra::bytesOf(a.component);
    if (a.view != kGltfNone) {
        base_ = resolve(document, a.view, a.offset, a.count, bytes, name_);
    } else {
        base_.stride = bytes;
        if (a.sparse == kGltfNone)
            throw InputError(buffers.path(), name_ + ".bufferView",
                             "is missing" + document.whyMissing());
        // note: nothing but a number backs the zeros, so that it might be any.
        uint64_t most = 0;
        for (const GltfBuffer& b : document.buffers) most += std::min(b.bytes, UINT64_MAX - most);
        if (a.count > most)
            throw InputError(
                buffers.path(), name_ + ".count",
                fmt::format("{} zeros are more than the {} bytes of all buffers", a.count, most));
    }
    if (a.sparse == kGltfNone) return;
    sparse_ = &document.sparse[a.sparse];
    if (sparse_->count > a.count)
        throw InputError(buffers.path(), name_ + ".sparse.count",
                         fmt::format("{} of {} elements", sparse_->count, a.count));
    if (sparse_->index_component == GltfComponent::kFloat)
        throw InputError(buffers.path(), name_ + ".sparse.indices.componentType",
                         "indices are real numbers");
    sparse_indices_ = resolve(document, sparse_->index_view, sparse_->index_offset, sparse_->count,
                              pietra::bytesOf(sparse_->index_component), name_ + ".sparse.indices");
    sparse_values_ = resolve(document, sparse_->value_view, sparse_->value_offset, sparse_->count,
                             bytes, name_ + ".sparse.values");
    seek(0);
}

GltfColumn::Range GltfColumn::resolve(const GltfDocument& document, uint32_t view, uint64_t offset,
                                      uint64_t count, uint64_t element_bytes,
                                      const std::string& what) {
    const auto fail = [&](const std::string& place, const std::string& text) {
        throw InputError(buffers_->path(), place, text);
    };
    if (view >= document.views.size())
        fail(what + ".bufferView",
             fmt::format("there is no view {}: there are {}", view, document.views.size()));
    const GltfView& v = document.views[view];
    const std::string view_name = fmt::format("bufferViews[{}]", view);
    if (v.buffer >= buffers_->count())
        fail(view_name + ".buffer",
             fmt::format("there is no buffer {}: there are {}", v.buffer, buffers_->count()));
    buffers_->require(v.buffer);
    const uint64_t room = buffers_->sizeOf(v.buffer);
    if (v.offset > room || v.bytes > room - v.offset)
        fail(view_name, fmt::format("{} bytes from {} on are not within a buffer of {}", v.bytes,
                                    v.offset, room));
    const uint64_t stride = v.stride ? v.stride : element_bytes;
    if (stride < element_bytes)
        fail(view_name + ".byteStride",
             fmt::format("{} is less than the {} bytes of an element", stride, element_bytes));
    const uint64_t left = v.bytes - std::min(offset, v.bytes);
    if (count > 0 && (left < element_bytes || (count - 1) > (left - element_bytes) / stride))
        fail(what, fmt::format("{} elements of {} bytes from {} on, every {}, are not within a "
                               "bufferView of {} bytes",
                               count, element_bytes, offset, stride, v.bytes));
    return {v.buffer, v.offset + offset, stride, element_bytes, v.offset, v.offset + v.bytes};
}

void GltfColumn::seek(uint64_t row) {
    row_ = row;
    if (!sparse_) return;
    if (row == 0) sparse_next_ = 0;
    if (sparse_next_ == 0) sparse_row_ = sparse_->count > 0 ? sparseIndex(0) : count();
    while (sparse_row_ < row) {
        ++sparse_next_;
        sparse_row_ = sparse_next_ < sparse_->count ? sparseIndex(sparse_next_) : count();
    }
}

/// The bytes of some elements, `range.stride` apart.
const uint8_t* GltfColumn::bytesOf(const Range& range, uint64_t first, size_t rows) {
    uint64_t begin = range.begin + first * range.stride;
    uint64_t end = begin + (rows - 1) * range.stride + range.bytes;
    // Columns that are interleaved ask for whole rows, and so for the same window.
    const uint64_t within = (range.begin - range.view_begin) % range.stride;
    const uint8_t* data = nullptr;
    if (within + range.bytes <= range.stride) {
        begin -= within;
        end = std::min(begin + rows * range.stride, range.view_end);
        data = buffers_->window(range.buffer, begin, end) + within;
    } else {
        data = buffers_->window(range.buffer, begin, end);
    }
    return data;
}

/// One element of the sparse part: read with its neighbours.
const uint8_t* GltfColumn::sparseElement(const Range& range, uint64_t number) {
    constexpr uint64_t kBlock = 1024;
    const uint64_t first = number / kBlock * kBlock;
    const auto rows = size_t(std::min(kBlock, sparse_->count - first));
    return bytesOf(range, first, rows) + (number - first) * range.stride;
}

uint64_t GltfColumn::sparseIndex(uint64_t number) {
    uint64_t index = 0;
    decode(sparse_->index_component, sparseElement(sparse_indices_, number), 0, 1, 1, false, &index,
           1);
    const bool ascends = number == 0 || index > sparse_row_;
    if (index >= count() || !ascends)
        throw InputError(buffers_->path(), name_ + ".sparse.indices",
                         ascends ? fmt::format("index {} of {} elements", index, count())
                                 : fmt::format("{} after {} does not ascend", index, sparse_row_));
    return index;
}

template <class T>
void GltfColumn::read(size_t rows, T* out, size_t out_stride, int components, bool normalize) {
    CHECK_LE(row_ + rows, count());
    normalize = normalize && accessor_->normalized;
    if (base_.buffer != kGltfNone) {
        decode(accessor_->component, bytesOf(base_, row_, rows), base_.stride, rows, components,
               normalize, out, out_stride);
    } else {
        for (size_t i = 0; i < rows; ++i) std::fill_n(out + i * out_stride, components, T(0));
    }
    while (sparse_ && sparse_row_ < row_ + rows) {
        decode(accessor_->component, sparseElement(sparse_values_, sparse_next_), 0, 1, components,
               normalize, out + (sparse_row_ - row_) * out_stride, out_stride);
        ++sparse_next_;
        sparse_row_ = sparse_next_ < sparse_->count ? sparseIndex(sparse_next_) : count();
    }
    row_ += rows;
}

template void GltfColumn::read(size_t, double*, size_t, int, bool);
template void GltfColumn::read(size_t, float*, size_t, int, bool);
template void GltfColumn::read(size_t, uint8_t*, size_t, int, bool);
template void GltfColumn::read(size_t, uint64_t*, size_t, int, bool);

std::string GltfColumn::placeOf(uint64_t row) const {
    if (base_.buffer == kGltfNone) return fmt::format("{}, element {}", name_, row);
    return fmt::format("{}, element {} ({})", name_, row,
                       buffers_->placeOf(base_.buffer, base_.begin + row * base_.stride));
}

}  // namespace pietra
