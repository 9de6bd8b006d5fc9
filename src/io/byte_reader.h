#pragma once
// A window that slides over a ByteSource: what binary decoders and text scanners read through.
//
// The bytes from the cursor on lie in one piece, at least as many as were asked for (up to kWindow)
// unless the file ends before. Scanners may look kPadding bytes back and ahead without asking:
// after the last byte there are zero bytes. Memory: kWindow, once read from. Not thread-safe.

#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "io/byte_source.h"

namespace pietra {

class ByteReader {
public:
    static constexpr size_t kWindow = 1 << 20;
    static constexpr size_t kPadding = 64;

    explicit ByteReader(std::unique_ptr<ByteSource> source);

    const ByteSource& source() const { return *source_; }
    /// Gives the source away, for other ways of reading; nothing but the destructor may follow.
    std::unique_ptr<ByteSource> takeSource() { return std::move(source_); }
    const std::string& path() const { return source_->path(); }
    /// Offset of the cursor from the start of the plain bytes.
    uint64_t offset() const { return base_ + cursor_; }
    /// Moves the cursor; beyond the end of the file there are no bytes.
    void seek(uint64_t offset);
    /// Makes min(want, what is left) bytes available at data(); returns how many there are, which
    /// may be more. want <= kWindow. Invalidates earlier pointers.
    size_t peek(size_t want) {
        if (end_ - cursor_ < want) fill();
        return end_ - cursor_;
    }
    const uint8_t* data() const { return buffer_.data() + kPadding + cursor_; }
    /// Moves the cursor over bytes that peek() has shown.
    void advance(size_t bytes) { cursor_ += bytes; }
    bool atEnd() { return peek(1) == 0; }
    /// Gives the window's memory and what the source holds back until the next read; the cursor
    /// stays.
    void release();

    /// "byte 17", or "byte 17 of the unpacked data", for messages.
    std::string placeOf(uint64_t offset) const;

private:
    void fill();

    std::unique_ptr<ByteSource> source_;
    size_t window_;                ///< kWindow, or the whole of a smaller file
    std::vector<uint8_t> buffer_;  ///< the window between kPadding bytes on either side
    uint64_t base_ = 0;            ///< offset of the window's first byte
    size_t cursor_ = 0;
    size_t end_ = 0;
};

}  // namespace pietra
