#pragma once
// The pages in graphics memory: one buffer of fixed size, and who has which part of it.
//
// Pages are copied from the upload ring by commands, in order with those that draw: what a page
// overwrites is read by no command after its copy, so its memory may be used again at once, without
// asking whether the GPU is done. Only the ring, which the CPU writes, needs fences.

#include <cstdint>
#include <span>
#include <unordered_map>
#include <vector>

#include "geometry/mesh.h"
#include "multires/draw_list.h"
#include "render/gl/arena.h"
#include "render/gl/page_format.h"
#include "render/gl/upload_ring.h"

namespace pietra {

/// A patch as glMultiDrawElementsIndirect() takes it.
struct StoredPatch {
    Vec3i corner, extent;  ///< of its box
    uint32_t indices;
    uint32_t first_index;
    int32_t base_vertex;
    bool wide;
    size_t indexBegin() const { return size_t(first_index) * (wide ? 4 : 2); }  ///< in the buffer
};

struct StoredPage {
    ArenaBlock block;
    VertexLayout layout;
    std::vector<StoredPatch> patches;
};

class PageStore {
public:
    /// The ring must outlive this.
    PageStore(size_t bytes, UploadRing& ring);

    /// False where there is no room for it, now. The key must not be in use.
    bool upload(PageKey key, std::span<const Mesh> patches);
    /// Of what upload() took; commands given so far still see it.
    void release(PageKey key);
    /// Null where there is no such page. Good until release().
    const StoredPage* find(PageKey key) const;

    GLuint buffer() const { return buffer_; }
    size_t used() const { return arena_.used(); }
    size_t capacity() const { return arena_.capacity(); }
    /// Copied so far.
    uint64_t uploadedBytes() const { return uploaded_bytes_; }

private:
    static uint64_t number(PageKey key) { return uint64_t(key.model) << 32 | key.page; }

    UploadRing& ring_;
    ArenaAllocator arena_;
    GlBuffer buffer_;
    std::unordered_map<uint64_t, StoredPage> pages_;
    uint64_t uploaded_bytes_ = 0;
};

}  // namespace pietra
