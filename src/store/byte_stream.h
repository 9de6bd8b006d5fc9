#pragma once
// Little-endian bytes in memory: a writer that grows a vector, and a reader of untrusted bytes that
// never reads past the end: after the first short read it stays failed and returns zeros.
// Varints are LEB128: seven bits a byte, low ones first, the top bit set on all but the last.

#include <bit>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

namespace pietra {

static_assert(std::endian::native == std::endian::little, "the file format is little-endian");

/// Signed to unsigned so that small magnitudes stay small: 0, -1, 1, -2, ... -> 0, 1, 2, 3, ...
/// Wraps, so that every 32-bit difference has a code.
inline uint32_t zigzag(uint32_t difference) {
    return difference << 1 ^ (0 - (difference >> 31));
}
inline uint32_t unzigzag(uint32_t code) {
    return code >> 1 ^ (0 - (code & 1));
}

class ByteWriter {
public:
    /// Appends to `out`, which must outlive this.
    explicit ByteWriter(std::vector<std::byte>& out) : out_(out) {}

    template <class T>
    void fixed(const T& value) {
        static_assert(std::is_trivially_copyable_v<T>);
        raw(&value, sizeof value);
    }
    void varint(uint64_t value) {
        while (value >= 0x80) {
            out_.push_back(std::byte(value | 0x80));
            value >>= 7;
        }
        out_.push_back(std::byte(value));
    }
    void raw(const void* data, size_t bytes) {
        const auto* begin = static_cast<const std::byte*>(data);
        out_.insert(out_.end(), begin, begin + bytes);
    }

private:
    std::vector<std::byte>& out_;
};

class ByteReader {
public:
    explicit ByteReader(std::span<const std::byte> bytes) : bytes_(bytes) {}

    template <class T>
    T fixed() {
        static_assert(std::is_trivially_copyable_v<T>);
        T value{};
        const std::span<const std::byte> source = take(sizeof value);
        if (ok_) std::memcpy(&value, source.data(), sizeof value);
        return value;
    }
    uint64_t varint() {
        uint64_t value = 0;
        for (int shift = 0; shift < 64; shift += 7) {
            const auto byte = uint64_t(fixed<uint8_t>());
            value |= (byte & 0x7f) << shift;
            if (byte < 0x80) return ok_ ? value : 0;
        }
        ok_ = false;
        return 0;
    }
    /// A varint that must not pass `limit`; fails otherwise.
    uint32_t varintUpTo(uint32_t limit) {
        const uint64_t value = varint();
        if (value > limit) ok_ = false;
        return ok_ ? uint32_t(value) : 0;
    }
    /// The next `bytes` bytes; empty and failed if there are fewer.
    std::span<const std::byte> take(size_t bytes) {
        if (bytes > bytes_.size()) ok_ = false;
        if (!ok_) return {};
        const std::span<const std::byte> taken = bytes_.first(bytes);
        bytes_ = bytes_.subspan(bytes);
        return taken;
    }
    size_t remaining() const { return bytes_.size(); }
    bool ok() const { return ok_; }

private:
    std::span<const std::byte> bytes_;
    bool ok_ = true;
};

}  // namespace pietra
