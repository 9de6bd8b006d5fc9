#pragma once
// What all page codecs share: the page's header, and the way byte streams are packed into one zstd
// frame. Internal to src/store.

#include <algorithm>
#include <array>
#include <span>
#include <string>
#include <vector>

#include "store/byte_stream.h"
#include "store/page_codec.h"

namespace pietra {

struct PatchHeader {
    uint32_t vertices = 0;
    uint32_t triangles = 0;
    Vec3i corner{0, 0, 0};  ///< least position of the patch, in units of 2^shift
};

struct PageHeader {
    uint8_t codec = 0;
    bool colours = false;
    int shift = 0;
    int normal_bits = 0;
    int scalar_count = 0;
    std::vector<PatchHeader> patches;

    uint64_t vertexCount() const;
    uint64_t triangleCount() const;
};

/// Edge classes of a triangle whose corner `first` becomes corner 0.
inline uint8_t rotateClasses(uint8_t classes, uint32_t first) {
    const unsigned low = classes & 63u;
    return uint8_t((low >> (2 * first) | low << (6 - 2 * first)) & 63u);
}

inline std::array<int32_t, 2> quantisedNormal(const OctNormal& normal, int bits) {
    return {quantiseNormal(std::max<int32_t>(normal.x, -32767), bits),
            quantiseNormal(std::max<int32_t>(normal.y, -32767), bits)};
}

PageHeader describePage(std::span<const Mesh* const> patches, const PageSettings& settings);
void writePageHeader(const PageHeader& header, ByteWriter& writer);
/// Checks everything that can be checked without the body, so that counts may be trusted to size
/// allocations.
[[nodiscard]] bool readPageHeader(ByteReader& reader, PageHeader& header, std::string& fault);

/// Byte streams on their way into a page: their lengths as varints, the length of a zstd frame as a
/// varint, and that frame, whose content is the streams one after the other. The encoder ends a
/// zstd block after each stream, so that each has Huffman codes of its own.
class StreamPacker {
public:
    /// A new stream, valid until the next call of add().
    std::vector<uint8_t>& add();
    void clear() { used_ = 0; }
    void write(ByteWriter& writer);

private:
    std::vector<std::vector<uint8_t>> streams_;
    size_t used_ = 0;
    std::vector<std::byte> frame_;
};

class StreamUnpacker {
public:
    /// Reads `count` streams; none may be longer than `longest`, the sum no longer than `total`.
    [[nodiscard]] bool read(ByteReader& reader, size_t count, uint64_t longest, uint64_t total,
                            std::string& fault);
    /// A stream. Some bytes after it may be read too: up to four, with any content.
    std::span<const uint8_t> operator[](size_t stream) const {
        return {bytes_.data() + begin_[stream], begin_[stream + 1] - begin_[stream]};
    }
    size_t size() const { return begin_.size() - 1; }

private:
    static constexpr size_t kSlack = 4;
    std::vector<uint8_t> bytes_;
    std::vector<size_t> begin_;
};

}  // namespace pietra
