#pragma once
// Text as its scanners walk over it: a pointer into the window of a ByteReader.
//
// Where p_ <= limit_, a word of up to kMaxWord characters lies in one piece from p_ on, with the
// byte that ends it; whoever may be beyond calls refill(), or need(). At end_ stands a zero byte,
// so a scanner that stops there needs no other test; a zero before end_ is the file's own.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string>

#include "io/byte_reader.h"

namespace pietra {

inline bool isBlankOrLineEnd(char c) {
    return c == ' ' || (c >= '\t' && c <= '\r');
}

/// The same byte eight times.
constexpr uint64_t eightTimes(uint8_t byte) {
    return byte * uint64_t(0x0101010101010101);
}
/// Eight bytes of a text, the first of them lowest.
inline uint64_t loadEight(const char* p) {
    static_assert(std::endian::native == std::endian::little);
    uint64_t bytes;
    std::memcpy(&bytes, p, sizeof bytes);
    return bytes;
}
/// The top bit of each byte: whether it is above the blank.
constexpr uint64_t solidBytes(uint64_t bytes) {
    return (((bytes & eightTimes(0x7f)) + eightTimes(0x7f - ' ')) | bytes) & eightTimes(0x80);
}
/// How many of eight bytes stand before the first that is not zero.
constexpr int zerosBefore(uint64_t bytes) {
    return bytes ? std::countr_zero(bytes) / 8 : 8;
}

class TextWindow {
public:
    static constexpr size_t kMaxWord = 1024;

    uint64_t offset() const { return reader_.offset() + uint64_t(p_ - window()); }
    void seek(uint64_t offset) {
        reader_.seek(offset);
        p_ = window();
        refill();
    }

protected:
    explicit TextWindow(ByteReader& reader) : reader_(reader) {}

    /// Makes sure that a whole word lies at p_, which may move.
    void need() {
        if (p_ > limit_) [[unlikely]]
            refill();
    }
    void refill(size_t want = kMaxWord) {
        reader_.advance(size_t(p_ - window()));
        const size_t available = reader_.peek(want);
        p_ = window();
        end_ = p_ + available;
        at_end_ = available < kMaxWord;
        limit_ = at_end_ ? end_ : end_ - kMaxWord;
    }
    /// What stands at `p` up to a blank, printable and not too long, for messages.
    std::string shownWord(const char* p) const {
        constexpr ptrdiff_t kLongest = 40;
        std::string word;
        for (; p < end_ && !isBlankOrLineEnd(*p); ++p) {
            if (word.size() == kLongest) return word + "...";
            word += *p < 127 && *p > ' ' ? *p : '?';
        }
        return word;
    }

    ByteReader& reader_;
    const char* p_ = nullptr;
    const char* end_ = nullptr;
    const char* limit_ = nullptr;
    bool at_end_ = false;  ///< end_ is the end of the file

private:
    const char* window() const { return reinterpret_cast<const char*>(reader_.data()); }
};

}  // namespace pietra
