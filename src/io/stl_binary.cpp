// Binary STL: 80 bytes of anything, a count, then 50 bytes a facet: normal, three corners, and 16
// bits that some programs (VisCAM, Materialise) keep a colour in.

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <cstring>

#include "base/error.h"
#include "io/stl_facets.h"

namespace pietra {

namespace {

constexpr size_t kHeaderBytes = 84, kCountOffset = 80;
constexpr size_t kFacetBytes = 50, kNormalBytes = 12, kCornerBytes = 36;
/// All bits of the exponent: what infinities and what is no number have.
constexpr uint32_t kExponent = 0x7f800000;

uint32_t loadCount(const uint8_t* header) {
    uint32_t count;
    std::memcpy(&count, header + kCountOffset, sizeof count);
    return count;
}

class BinaryStl : public StlFacets {
public:
    explicit BinaryStl(ByteReader& reader) : reader_(reader) {
        reader.seek(0);
        const size_t size = reader.peek(kHeaderBytes);
        if (size < kHeaderBytes)
            throw InputError(reader.path(), "",
                             fmt::format("is too short for an STL file: {} bytes", size));
        count_ = loadCount(reader.data());
        if (!reader.source().isCompressed()) {
            const uint64_t room = (reader.source().lengthBound() - kHeaderBytes) / kFacetBytes;
            if (count_ != room) failCount(fmt::format("has room for {}", room));
        }
        if (count_ == 0) throw InputError(reader.path(), "", "has no triangles: nothing to show");
    }

    StlPlace start() const override { return {.offset = kHeaderBytes}; }
    std::optional<uint64_t> count() const override { return count_; }

    size_t read(StlPlace& place, std::span<Vec3d> corners) override {
        const auto wanted = size_t(std::min<uint64_t>(corners.size() / 3, count_ - place.facet));
        reader_.seek(place.offset);
        size_t done = 0;
        while (done < wanted) {
            const size_t whole = reader_.peek(kFacetBytes) / kFacetBytes;
            const size_t n = std::min(wanted - done, whole);
            if (n == 0) failCount(fmt::format("ends after {}", place.facet));
            decode(place, corners.subspan(3 * done, 3 * n));
            reader_.advance(n * kFacetBytes);
            place.facet += n;
            done += n;
        }
        place.offset = reader_.offset();
        if (place.facet == count_) checkEnd();
        return done;
    }

    std::vector<std::string> notes() const override {
        std::vector<std::string> notes;
        if (attributes_seen_ > 0)
            notes.push_back(fmt::format(
                "the 16-bit attributes of {} facets (colours, in some programs) are left out",
                attributes_seen_));
        if (bytes_after_ > 0)
            notes.push_back(
                fmt::format("{} bytes after the last triangle are left out", bytes_after_));
        return notes;
    }

private:
    [[noreturn]] void failCount(const std::string& what) const {
        throw InputError(
            reader_.path(), reader_.placeOf(kCountOffset),
            fmt::format("the header counts {} triangles, but the file {}", count_, what));
    }

    void decode(const StlPlace& place, std::span<Vec3d> corners) {
        const uint8_t* in = reader_.data();
        uint32_t attributes = 0;
        bool finite = true;
        for (size_t i = 0; i < corners.size(); i += 3, in += kFacetBytes) {
            uint32_t bits[9];
            float values[9];
            std::memcpy(bits, in + kNormalBytes, kCornerBytes);
            std::memcpy(values, bits, kCornerBytes);
            double* const out = &corners[i].x;
            for (int k = 0; k < 9; ++k) {
                finite &= (bits[k] & kExponent) != kExponent;
                out[k] = double(values[k]);
            }
            uint16_t attribute;
            std::memcpy(&attribute, in + kNormalBytes + kCornerBytes, sizeof attribute);
            attributes += attribute != 0;
        }
        if (!finite) failPoint(place, corners);
        countAttributes(place.facet + corners.size() / 3, attributes);
    }

    /// The facets up to number `end` were read: counted when they are read for the first time.
    void countAttributes(uint64_t end, uint64_t attributes) {
        if (end <= facets_seen_) return;
        facets_seen_ = end;
        attributes_seen_ += attributes;
    }

    [[noreturn]] void failPoint(const StlPlace& place, std::span<const Vec3d> corners) const {
        size_t corner = 0;
        const auto at = [&] { return corners[corner]; };
        while (std::isfinite(at().x) && std::isfinite(at().y) && std::isfinite(at().z)) ++corner;
        const uint64_t offset =
            reader_.offset() + corner / 3 * kFacetBytes + kNormalBytes + corner % 3 * 12;
        throw InputError(
            reader_.path(), reader_.placeOf(offset),
            fmt::format("corner {} of triangle {} is at ({}, {}, {}), which is no point",
                        corner % 3, place.facet + corner / 3, at().x, at().y, at().z));
    }

    void checkEnd() {
        bytes_after_ = reader_.peek(kFacetBytes);
        if (bytes_after_ >= kFacetBytes) failCount("goes on after them");
    }

    ByteReader& reader_;
    uint64_t count_ = 0;
    uint64_t facets_seen_ = 0;
    uint64_t attributes_seen_ = 0;
    size_t bytes_after_ = 0;
};

}  // namespace

std::unique_ptr<StlFacets> openBinaryStl(ByteReader& reader) {
    return std::make_unique<BinaryStl>(reader);
}

bool isBinaryStlSize(std::span<const uint8_t> head, uint64_t bytes) {
    return head.size() >= kHeaderBytes &&
           bytes == kHeaderBytes + uint64_t(loadCount(head.data())) * kFacetBytes;
}

bool isStlText(ByteReader& reader) {
    constexpr size_t kHead = 4096;
    reader.seek(0);
    const size_t size = std::min(reader.peek(kHead), kHead);
    const std::span<const uint8_t> head(reader.data(), size);
    const uint64_t bytes = reader.source().isCompressed() ? 0 : reader.source().lengthBound();
    // Text has no zero bytes; binary data has them in the attributes of the first facets.
    return beginsAsStlText(head) && !isBinaryStlSize(head, bytes) &&
           std::find(head.begin(), head.end(), 0) == head.end();
}

}  // namespace pietra
