#include "render/gl/upload_ring.h"

#include <fmt/format.h>

#include "base/check.h"
#include "base/error.h"
#include "base/text.h"

namespace pietra {
namespace {

constexpr GLuint64 kWaitNanoseconds = 1000000000;

}  // namespace

UploadRing::UploadRing(size_t bytes) : bytes_(bytes) {
    CHECK_EQ(bytes % 2048, size_t(0));
    constexpr GLbitfield kAccess = GL_MAP_WRITE_BIT | GL_MAP_PERSISTENT_BIT | GL_MAP_COHERENT_BIT;
    GLuint name = 0;
    glCreateBuffers(1, &name);
    buffer_ = GlBuffer(name);
    glNamedBufferStorage(buffer_, GLsizeiptr(bytes), nullptr, kAccess);
    memory_ =
        static_cast<std::byte*>(glMapNamedBufferRange(buffer_, 0, GLsizeiptr(bytes), kAccess));
    if (memory_ == nullptr)
        throw MemoryError(fmt::format("the driver maps no {} of memory", formatBytes(bytes)));
}

UploadRing::~UploadRing() {
    for (const Fence& fence : fences_) glDeleteSync(fence.sync);
}

void UploadRing::reclaim(bool wait) {
    while (!fences_.empty()) {
        const Fence fence = fences_.front();
        const GLenum state = glClientWaitSync(fence.sync, wait ? GL_SYNC_FLUSH_COMMANDS_BIT : 0,
                                              wait ? kWaitNanoseconds : 0);
        if (state == GL_TIMEOUT_EXPIRED) {
            if (wait) continue;
            return;
        }
        CHECK(state != GL_WAIT_FAILED);
        glDeleteSync(fence.sync);
        fences_.pop_front();
        tail_ = fence.end;
        wait = false;
    }
}

size_t UploadRing::room() {
    reclaim(false);
    // Pieces never wrap around, which may leave the end of the buffer empty.
    const size_t left = bytes_ - (head_ - tail_);
    return left > largest() ? left - largest() : 0;
}

RingSpace UploadRing::take(size_t bytes, size_t alignment) {
    size_t begin = (head_ + alignment - 1) & ~(alignment - 1);
    if (begin % bytes_ + bytes > bytes_) begin = (begin / bytes_ + 1) * bytes_;
    CHECK_LE(begin + bytes - used_, 2 * largest());
    while (begin + bytes - tail_ > bytes_) {
        // What is without a fence and what is about to be used are less than half of the ring.
        CHECK(!fences_.empty());
        reclaim(true);
    }
    head_ = begin + bytes;
    return {memory_ + begin % bytes_, GLintptr(begin % bytes_)};
}

void UploadRing::used() {
    used_ = head_;
    if (used_ - fenced_ < largest()) return;  // small pieces share a fence
    fences_.push_back({glFenceSync(GL_SYNC_GPU_COMMANDS_COMPLETE, 0), used_});
    fenced_ = used_;
}

}  // namespace pietra
