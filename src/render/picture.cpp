#include "render/picture.h"

#include <png.h>
#include <zlib.h>
#include <zstd.h>

#include <bit>
#include <cstring>
#include <limits>
#include <span>
#include <string_view>

#include "base/check.h"
#include "base/error.h"
#include "extmem/file.h"

namespace pietra {
namespace {

using Bytes = std::vector<uint8_t>;

constexpr std::string_view kDepthChunk = "piDZ";
constexpr uint8_t kVersion = 1;
constexpr size_t kHeaderBytes = 4 + 4 + 4 + 8;
constexpr size_t kSignatureBytes = 8;
constexpr size_t kEndChunkBytes = 12;
constexpr uint64_t kMaxPixels = uint64_t(1) << 28;
/// One bit a pixel, and deflate packs at most 1032 bytes into one: memory is taken only for what
/// the file may hold.
constexpr uint64_t kMaxPixelsPerByte = 8 * 1032;

/// Chunks, unlike the rest of the format here, are big-endian.
void appendBigEndian(Bytes& out, uint32_t value) {
    for (int shift = 24; shift >= 0; shift -= 8) out.push_back(uint8_t(value >> shift));
}

uint32_t readBigEndian(const uint8_t* p) {
    return uint32_t(p[0]) << 24 | uint32_t(p[1]) << 16 | uint32_t(p[2]) << 8 | uint32_t(p[3]);
}

template <class T>
void appendRaw(Bytes& out, const T& value) {
    const auto* p = reinterpret_cast<const uint8_t*>(&value);
    out.insert(out.end(), p, p + sizeof(T));
}

template <class T>
T readRaw(const uint8_t* p) {
    T value;
    std::memcpy(&value, p, sizeof(T));
    return value;
}

// Neighbouring depths share their sign, exponent and upper bits: the differences' upper planes are
// nearly constant, and zstd leaves little of them.

uint32_t depthBits(float depth) {
    return depth == std::numeric_limits<float>::infinity() ? 0 : std::bit_cast<uint32_t>(depth);
}

Bytes depthPlanes(const Picture& picture) {
    const size_t count = picture.pixelCount(), width = size_t(picture.size.width);
    Bytes planes(4 * count);
    for (size_t i = 0; i < count; ++i) {
        const uint32_t before = i % width != 0 ? depthBits(picture.depth[i - 1])
                                : i >= width   ? depthBits(picture.depth[i - width])
                                               : 0;
        const uint32_t delta = depthBits(picture.depth[i]) - before;
        for (size_t k = 0; k < 4; ++k) planes[k * count + i] = uint8_t(delta >> (8 * k));
    }
    return planes;
}

std::vector<float> depthFromPlanes(const Bytes& planes, size_t width) {
    const size_t count = planes.size() / 4;
    std::vector<uint32_t> bits(count);
    std::vector<float> depth(count);
    for (size_t i = 0; i < count; ++i) {
        uint32_t delta = 0;
        for (size_t k = 0; k < 4; ++k) delta |= uint32_t(planes[k * count + i]) << (8 * k);
        bits[i] = delta + (i % width != 0 ? bits[i - 1] : i >= width ? bits[i - width] : 0);
        depth[i] =
            bits[i] == 0 ? std::numeric_limits<float>::infinity() : std::bit_cast<float>(bits[i]);
    }
    return depth;
}

Bytes encodeDepth(const Picture& picture) {
    const Bytes planes = depthPlanes(picture);
    Bytes out{kVersion, 0, 0, 0};
    appendRaw(out, uint32_t(picture.size.width));
    appendRaw(out, uint32_t(picture.size.height));
    appendRaw(out, picture.focal_px);
    out.resize(kHeaderBytes + ZSTD_compressBound(planes.size()));
    const size_t packed = ZSTD_compress(out.data() + kHeaderBytes, out.size() - kHeaderBytes,
                                        planes.data(), planes.size(), 1);
    CHECK(!ZSTD_isError(packed));
    out.resize(kHeaderBytes + packed);
    return out;
}

Bytes chunkOf(std::string_view type, const Bytes& content) {
    CHECK_LE(content.size(), size_t(0x7fffffff));
    Bytes chunk;
    chunk.reserve(content.size() + 12);
    appendBigEndian(chunk, uint32_t(content.size()));
    chunk.insert(chunk.end(), type.begin(), type.end());
    chunk.insert(chunk.end(), content.begin(), content.end());
    appendBigEndian(chunk, uint32_t(crc32(0, chunk.data() + 4, uInt(chunk.size() - 4))));
    return chunk;
}

Bytes encodeColour(const Picture& picture) {
    std::vector<uint8_t> rgb(3 * picture.pixelCount());
    for (size_t i = 0; i < picture.pixelCount(); ++i) {
        rgb[3 * i] = picture.colour[i].r;
        rgb[3 * i + 1] = picture.colour[i].g;
        rgb[3 * i + 2] = picture.colour[i].b;
    }
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    image.width = png_uint_32(picture.size.width);
    image.height = png_uint_32(picture.size.height);
    image.format = PNG_FORMAT_RGB;
    image.flags = PNG_IMAGE_FLAG_FAST;
    Bytes file(PNG_IMAGE_PNG_SIZE_MAX(image));
    png_alloc_size_t bytes = file.size();
    const int written =
        png_image_write_to_memory(&image, file.data(), &bytes, 0, rgb.data(), 0, nullptr);
    CHECK(written != 0);
    file.resize(bytes);
    return file;
}

struct ChunkView {
    std::span<const uint8_t> content;
    uint64_t offset = 0;  ///< of the content, in the file
    bool found = false;
};

/// The chunk of a type, if there is one. libpng has already accepted the picture, but it does not
/// look at what follows the last pixel.
ChunkView findChunk(const std::string& path, const Bytes& file, std::string_view type) {
    ChunkView result;
    std::string_view name;
    for (size_t at = kSignatureBytes; name != "IEND";) {
        if (at + kEndChunkBytes > file.size())
            throw InputError::atByte(path, file.size(), "the PNG ends early");
        const size_t length = readBigEndian(&file[at]);
        if (length > file.size() - at - kEndChunkBytes)
            throw InputError::atByte(path, file.size(), "the PNG ends early");
        name = std::string_view(reinterpret_cast<const char*>(&file[at + 4]), 4);
        if (name == type) {
            if (readBigEndian(&file[at + 8 + length]) !=
                uint32_t(crc32(0, &file[at + 4], uInt(length + 4))))
                throw InputError::atByte(path, at, "the depth chunk has a wrong checksum");
            result = {std::span(file).subspan(at + 8, length), at + 8, true};
        }
        at += length + kEndChunkBytes;
    }
    return result;
}

void decodeDepth(const std::string& path, const ChunkView& chunk, Picture& picture) {
    const auto refuse = [&](const char* what) {
        throw InputError::atByte(path, chunk.offset, what);
    };
    if (chunk.content.size() < kHeaderBytes) refuse("the depth chunk is too short");
    const uint8_t* p = chunk.content.data();
    if (p[0] != kVersion) refuse("the depth chunk is of an unknown version");
    if (readRaw<uint32_t>(p + 4) != uint32_t(picture.size.width) ||
        readRaw<uint32_t>(p + 8) != uint32_t(picture.size.height))
        refuse("the depth chunk is of another size than the picture");
    const double focal = readRaw<double>(p + 12);
    if (!(focal > 0) || !(focal < 1e9)) refuse("the depth chunk has no valid focal length");
    Bytes planes(4 * picture.pixelCount());
    const size_t unpacked = ZSTD_decompress(planes.data(), planes.size(), p + kHeaderBytes,
                                            chunk.content.size() - kHeaderBytes);
    if (ZSTD_isError(unpacked) || unpacked != planes.size()) refuse("the depth chunk is damaged");
    picture.depth = depthFromPlanes(planes, size_t(picture.size.width));
    for (const float depth : picture.depth)
        if (!(depth > 0)) refuse("the depth chunk holds a depth that is not positive");
    picture.focal_px = focal;
}

void decodeColour(const std::string& path, const Bytes& file, Picture& picture) {
    png_image image{};
    image.version = PNG_IMAGE_VERSION;
    // Frees what libpng holds on every way out.
    struct Guard {
        png_image* image;
        ~Guard() { png_image_free(image); }
    } guard{&image};
    if (png_image_begin_read_from_memory(&image, file.data(), file.size()) == 0)
        throw InputError(path, "", std::string("not a readable PNG: ") + image.message);
    if (uint64_t(image.width) * image.height > kMaxPixels)
        throw InputError(path, "", "the picture has more than 2^28 pixels");
    if (uint64_t(image.width) * image.height > kMaxPixelsPerByte * file.size())
        throw InputError::atByte(path, file.size(), "the PNG ends early");
    image.format = PNG_FORMAT_RGBA;
    picture.size = {int(image.width), int(image.height)};
    picture.colour.resize(picture.pixelCount());
    if (png_image_finish_read(&image, nullptr, picture.colour.data(), 0, nullptr) == 0)
        throw InputError(path, "", std::string("damaged PNG: ") + image.message);
}

/// Of what is no PNG, only so much as tells.
Bytes readWhole(const std::string& path) {
    File file(path, File::Mode::kRead);
    Bytes bytes;
    constexpr size_t kStep = 1 << 20;
    for (size_t got = kStep, used = 0; got == kStep; used += got) {
        bytes.resize(used + kStep);
        got = file.readSome(bytes.data() + used, kStep);
        bytes.resize(used + got);
        if (used == 0 && (got < 8 || png_sig_cmp(bytes.data(), 0, 8) != 0)) break;
    }
    return bytes;
}

}  // namespace

void writePng(const Picture& picture, const std::string& path, bool force) {
    CHECK_EQ(picture.colour.size(), picture.pixelCount());
    AtomicFile out(path, force);
    const Bytes png = encodeColour(picture);
    const size_t body = png.size() - kEndChunkBytes;
    out.file().write(png.data(), body);
    if (picture.hasDepth()) {
        CHECK_EQ(picture.depth.size(), picture.pixelCount());
        const Bytes chunk = chunkOf(kDepthChunk, encodeDepth(picture));
        out.file().write(chunk.data(), chunk.size());
    }
    out.file().write(png.data() + body, kEndChunkBytes);
    out.commit();
}

Picture readPicture(const std::string& path) {
    const Bytes file = readWhole(path);
    Picture picture;
    decodeColour(path, file, picture);
    const ChunkView chunk = findChunk(path, file, kDepthChunk);
    if (chunk.found) decodeDepth(path, chunk, picture);
    return picture;
}

}  // namespace pietra
