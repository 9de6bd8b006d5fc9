#pragma once
// A ring of memory that the CPU writes and the GPU reads, mapped for good: what is uploaded, and
// the lists of each draw. Space is taken in order and comes back in order, when the GPU has
// passed a fence after its last use. Needs a current context.

#include <cstddef>
#include <deque>

#include "gpu/program.h"

namespace pietra {

struct RingSpace {
    std::byte* memory;  ///< write only
    GLintptr offset;    ///< in the ring's buffer
};

class UploadRing {
public:
    /// `bytes`: a multiple of 2048. Throws MemoryError where the driver has none.
    explicit UploadRing(size_t bytes);
    ~UploadRing();
    UploadRing(const UploadRing&) = delete;
    UploadRing& operator=(const UploadRing&) = delete;

    /// What may be taken in sum between two calls of used().
    size_t largest() const { return bytes_ / 8; }
    /// What can be taken now, piece by piece, without waiting for the GPU.
    size_t room();
    /// Waits until there is space. `alignment`: a power of two of at most 256.
    RingSpace take(size_t bytes, size_t alignment);
    /// All commands that read what was taken so far have been given.
    void used();

    GLuint buffer() const { return buffer_; }

private:
    struct Fence {
        GLsync sync;
        size_t end;  // of what it guards
    };
    void reclaim(bool wait);

    const size_t bytes_;
    GlBuffer buffer_;
    std::byte* memory_ = nullptr;
    // Positions grow for ever; modulo bytes_ they are places in the buffer.
    size_t head_ = 0, tail_ = 0, used_ = 0, fenced_ = 0;
    std::deque<Fence> fences_;
};

}  // namespace pietra
