#include "store/page_format.h"

#include <fmt/format.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

#include "base/check.h"
#include "geometry/lattice.h"

namespace pietra {

namespace {

constexpr uint8_t kColoursFlag = 1;
// The streams are residuals: they have to be entropy-coded, and have no repetitions worth a search.
// Short chance matches cost more than the literals they replace: ask for long ones, in a small
// table.
constexpr int kZstdLevel = 1;
constexpr int kZstdMinMatch = 7;
constexpr int kZstdHashLog = 6;

struct FreeContext {
    void operator()(ZSTD_CCtx* context) const { ZSTD_freeCCtx(context); }
    void operator()(ZSTD_DCtx* context) const { ZSTD_freeDCtx(context); }
};

ZSTD_CCtx* threadCompressor() {
    thread_local const std::unique_ptr<ZSTD_CCtx, FreeContext> context(ZSTD_createCCtx());
    CHECK(context != nullptr);
    return context.get();
}

ZSTD_DCtx* threadDecompressor() {
    thread_local const std::unique_ptr<ZSTD_DCtx, FreeContext> context(ZSTD_createDCtx());
    CHECK(context != nullptr);
    return context.get();
}

void checkPatch(const Mesh& mesh, const PageSettings& settings) {
    const size_t n = mesh.vertexCount();
    CHECK_LE(n, size_t(kMaxPageVertices));
    CHECK_LE(mesh.triangleCount(), size_t(kMaxPageTriangles));
    CHECK_EQ(mesh.edge_class.size(), mesh.triangleCount());
    CHECK_EQ(mesh.normal.size(), n);
    CHECK_EQ(mesh.colour.size(), settings.colours ? n : 0);
    CHECK_EQ(mesh.scalar.size(), n * size_t(settings.scalar_count));
    const int32_t off_lattice = (1 << settings.shift) - 1;
    int32_t bad = 0;
    for (const Vec3i& p : mesh.position) {
        const int32_t any = p.x | p.y | p.z;
        bad |= any & off_lattice;
        bad |= int32_t(p.x > kLatticeMax) | int32_t(p.y > kLatticeMax) | int32_t(p.z > kLatticeMax);
        bad |= any >> 31;
    }
    CHECK(bad == 0 && "positions on the lattice");
    uint32_t largest = 0;
    for (const Triangle& t : mesh.triangle)
        largest = std::max(largest, std::max(t[0], std::max(t[1], t[2])));
    CHECK(mesh.triangle.empty() || largest < n);
}

}  // namespace

uint64_t PageHeader::vertexCount() const {
    uint64_t sum = 0;
    for (const PatchHeader& patch : patches) sum += patch.vertices;
    return sum;
}

uint64_t PageHeader::triangleCount() const {
    uint64_t sum = 0;
    for (const PatchHeader& patch : patches) sum += patch.triangles;
    return sum;
}

PageHeader describePage(std::span<const Mesh* const> patches, const PageSettings& settings) {
    CHECK_LE(patches.size(), size_t(kMaxPagePatches));
    CHECK(settings.shift >= 0 && settings.shift <= kMaxLatticeShift);
    CHECK(settings.normal_bits >= kMinNormalBits && settings.normal_bits <= kMaxNormalBits);
    CHECK(settings.scalar_count >= 0 && settings.scalar_count <= kMaxScalars);
    PageHeader header{
        0, settings.colours, settings.shift, settings.normal_bits, settings.scalar_count, {}};
    for (const Mesh* mesh : patches) {
        checkPatch(*mesh, settings);
        PatchHeader patch{uint32_t(mesh->vertexCount()), uint32_t(mesh->triangleCount()), {}};
        if (patch.vertices > 0) {
            Vec3i corner = mesh->position[0];
            for (const Vec3i& p : mesh->position) corner = glm::min(corner, p);
            patch.corner = corner >> settings.shift;
        }
        header.patches.push_back(patch);
    }
    CHECK_LE(header.vertexCount(), uint64_t(kMaxPageVertices));
    CHECK_LE(header.triangleCount(), uint64_t(kMaxPageTriangles));
    return header;
}

void writePageHeader(const PageHeader& header, ByteWriter& writer) {
    writer.fixed(header.codec);
    writer.fixed(uint8_t(header.colours ? kColoursFlag : 0));
    writer.fixed(uint8_t(header.shift));
    writer.fixed(uint8_t(header.normal_bits));
    writer.fixed(uint8_t(header.scalar_count));
    writer.varint(header.patches.size());
    for (const PatchHeader& patch : header.patches) {
        writer.varint(patch.vertices);
        writer.varint(patch.triangles);
        if (patch.vertices > 0)
            for (int axis = 0; axis < 3; ++axis) writer.varint(uint32_t(patch.corner[axis]));
    }
}

bool readPageHeader(ByteReader& reader, PageHeader& header, std::string& fault) {
    header.codec = reader.fixed<uint8_t>();
    const auto flags = reader.fixed<uint8_t>();
    header.shift = reader.fixed<uint8_t>();
    header.normal_bits = reader.fixed<uint8_t>();
    header.scalar_count = reader.fixed<uint8_t>();
    const uint32_t patch_count = reader.varintUpTo(kMaxPagePatches);
    if (!reader.ok() || patch_count > reader.remaining()) {
        fault = "its header is cut short";
        return false;
    }
    header.colours = (flags & kColoursFlag) != 0;
    if ((flags & ~kColoursFlag) != 0 || header.shift > kMaxLatticeShift ||
        header.normal_bits < kMinNormalBits || header.normal_bits > kMaxNormalBits) {
        fault = "its header is not one this version knows";
        return false;
    }
    header.patches.resize(patch_count);
    const auto corner_max = uint32_t(kLatticeMax >> header.shift);
    uint64_t vertices = 0, triangles = 0;
    for (PatchHeader& patch : header.patches) {
        patch = {};
        patch.vertices = reader.varintUpTo(kMaxPageVertices);
        patch.triangles = reader.varintUpTo(kMaxPageTriangles);
        if (patch.vertices > 0)
            for (int axis = 0; axis < 3; ++axis)
                patch.corner[axis] = int32_t(reader.varintUpTo(corner_max));
        vertices += patch.vertices;
        triangles += patch.triangles;
        if (patch.triangles > 0 && patch.vertices == 0) triangles = kMaxPageTriangles + 1;
    }
    if (!reader.ok() || vertices > kMaxPageVertices || triangles > kMaxPageTriangles) {
        fault = "its header states impossible counts";
        return false;
    }
    return true;
}

std::vector<uint8_t>& StreamPacker::add() {
    if (used_ == streams_.size()) streams_.emplace_back();
    std::vector<uint8_t>& stream = streams_[used_++];
    stream.clear();
    return stream;
}

void StreamPacker::write(ByteWriter& writer) {
    size_t total = 0;
    for (size_t i = 0; i < used_; ++i) {
        writer.varint(streams_[i].size());
        total += streams_[i].size();
    }
    if (total == 0) {
        writer.varint(0);
        return;
    }
    ZSTD_CCtx* context = threadCompressor();
    ZSTD_CCtx_reset(context, ZSTD_reset_session_and_parameters);
    ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, kZstdLevel);
    ZSTD_CCtx_setParameter(context, ZSTD_c_minMatch, kZstdMinMatch);
    ZSTD_CCtx_setParameter(context, ZSTD_c_hashLog, kZstdHashLog);
    ZSTD_CCtx_setPledgedSrcSize(context, total);
    frame_.resize(ZSTD_compressBound(total) + 16 * (used_ + 1));
    ZSTD_outBuffer out{frame_.data(), frame_.size(), 0};
    size_t done = 0;
    for (size_t i = 0; i < used_; ++i) {
        if (streams_[i].empty()) continue;
        done += streams_[i].size();
        ZSTD_inBuffer in{streams_[i].data(), streams_[i].size(), 0};
        const size_t left =
            ZSTD_compressStream2(context, &out, &in, done == total ? ZSTD_e_end : ZSTD_e_flush);
        CHECK_EQ(left, size_t(0));
        CHECK_EQ(in.pos, in.size);
    }
    writer.varint(out.pos);
    writer.raw(frame_.data(), out.pos);
}

bool StreamUnpacker::read(ByteReader& reader, size_t count, uint64_t longest, uint64_t total,
                          std::string& fault) {
    begin_.assign(1, 0);
    for (size_t i = 0; i < count; ++i) {
        const uint64_t length = reader.varint();
        if (!reader.ok() || length > longest || begin_.back() + length > total) {
            fault = "the lengths of its streams are impossible";
            return false;
        }
        begin_.push_back(begin_.back() + size_t(length));
    }
    const uint64_t frame_bytes = reader.varint();
    const std::span<const std::byte> frame = reader.take(size_t(frame_bytes));
    if (!reader.ok() || reader.remaining() != 0) {
        fault = "its compressed part does not end with the page";
        return false;
    }
    bytes_.resize(begin_.back() + kSlack);
    if (begin_.back() == 0 && frame.empty()) return true;
    const size_t got = ZSTD_decompressDCtx(threadDecompressor(), bytes_.data(), begin_.back(),
                                           frame.data(), frame.size());
    if (ZSTD_isError(got) || got != begin_.back()) {
        fault = fmt::format("its compressed part is damaged ({})",
                            ZSTD_isError(got) ? ZSTD_getErrorName(got) : "too short");
        return false;
    }
    return true;
}

}  // namespace pietra
