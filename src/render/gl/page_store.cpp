#include "render/gl/page_store.h"

#include <algorithm>

#include "base/check.h"

namespace pietra {
namespace {

/// Indices are counted by 32 bits in the buffer: at 2 bytes each.
constexpr size_t kLargestArena = size_t(1) << 33;

/// Writes a page front to back through the ring, in as few copies as fit it.
class PageWriter {
public:
    PageWriter(UploadRing& ring, GLuint target, size_t offset, size_t bytes)
        : ring_(ring), target_(target), offset_(offset), left_(bytes) {}

    /// put(first, count, memory) writes `count` elements of `size` bytes; called for all elements,
    /// piece by piece.
    template <class Put>
    void write(size_t elements, size_t size, const Put& put) {
        for (size_t first = 0; first < elements;) {
            if (piece_ - filled_ < size) next();
            const size_t count = std::min(elements - first, (piece_ - filled_) / size);
            put(first, count, space_.memory + filled_);
            filled_ += count * size;
            first += count;
        }
    }
    /// Leaves out up to 3 bytes.
    void align() {
        const size_t aligned = (filled_ + 3) / 4 * 4;
        filled_ = std::min(aligned, piece_);
    }
    /// Copies what is left to copy.
    void finish() {
        if (filled_ > 0)
            glCopyNamedBufferSubData(ring_.buffer(), target_, space_.offset, GLintptr(offset_),
                                     GLsizeiptr(filled_));
        ring_.used();
        offset_ += filled_;
        left_ -= filled_;
        piece_ = filled_ = 0;
    }

private:
    void next() {
        finish();
        piece_ = std::min(left_, ring_.largest()) / 4 * 4;
        space_ = ring_.take(piece_, 4);
    }

    UploadRing& ring_;
    GLuint target_;
    size_t offset_, left_;
    RingSpace space_{};
    size_t piece_ = 0, filled_ = 0;
};

}  // namespace

PageStore::PageStore(size_t bytes, UploadRing& ring)
    : ring_(ring), arena_(std::min(bytes, kLargestArena)) {
    CHECK_LT(size_t(0), arena_.capacity());
    GLuint name = 0;
    glCreateBuffers(1, &name);
    buffer_ = GlBuffer(name);
    glNamedBufferStorage(buffer_, GLsizeiptr(arena_.capacity()), nullptr, 0);
}

bool PageStore::upload(PageKey key, std::span<const Mesh> patches) {
    CHECK(find(key) == nullptr);
    const PageShape shape = shapeOf(patches);
    const size_t stride = shape.layout.stride();
    // The vertices begin at a multiple of their size.
    const auto block = arena_.allocate(shape.bytes + stride);
    if (!block) return false;
    const size_t begin = (block->offset + stride - 1) / stride * stride;

    StoredPage page{*block, shape.layout, {}};
    for (const PatchRange& range : shape.patches) {
        const size_t index_begin = begin + range.index_offset;
        page.patches.push_back({range.corner, range.extent, range.indices,
                                uint32_t(index_begin / (range.wide ? 4 : 2)),
                                int32_t(begin / stride + range.first_vertex), range.wide});
    }
    PageWriter writer(ring_, buffer_, begin, shape.bytes);
    for (size_t i = 0; i < patches.size(); ++i)
        writer.write(shape.patches[i].vertices, stride, [&](size_t first, size_t n, std::byte* to) {
            packVertices(patches[i], shape.layout, shape.patches[i].corner, first, n, to);
        });
    for (size_t i = 0; i < patches.size(); ++i) {
        const bool wide = shape.patches[i].wide;
        writer.write(shape.patches[i].indices, wide ? 4 : 2,
                     [&](size_t first, size_t n, std::byte* to) {
                         packIndices(patches[i], wide, first, n, to);
                     });
        writer.align();
    }
    writer.finish();
    uploaded_bytes_ += shape.bytes;
    pages_.emplace(number(key), std::move(page));
    return true;
}

void PageStore::release(PageKey key) {
    const auto found = pages_.find(number(key));
    CHECK(found != pages_.end());
    arena_.free(found->second.block);
    pages_.erase(found);
}

const StoredPage* PageStore::find(PageKey key) const {
    const auto found = pages_.find(number(key));
    return found == pages_.end() ? nullptr : &found->second;
}

}  // namespace pietra
