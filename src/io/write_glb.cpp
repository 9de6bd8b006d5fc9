// Binary glTF 2.0: a 12-byte head, a JSON chunk, a chunk of data. Vertices are interleaved, so that
// they can be written as they come; the JSON chunk has a fixed size and is filled in at the end.

#include <fmt/format.h>

#include <limits>

#include "base/check.h"
#include "base/error.h"
#include "io/mesh_writers.h"

namespace pietra {

namespace {

constexpr uint32_t kMagic = 0x46546c67, kJsonChunk = 0x4e4f534a, kDataChunk = 0x004e4942;
constexpr size_t kHeadBytes = 12, kChunkHeadBytes = 8;
/// Strides of vertices are at most this in glTF.
constexpr size_t kLargestStride = 252;

/// The name of an application's own attribute: "_" and capitals.
std::string attributeName(const std::string& name) {
    std::string out = "_";
    for (const char c : name) {
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        const bool digit = c >= '0' && c <= '9';
        out += c >= 'a' && c <= 'z' ? char(c - 32) : letter || digit ? c : '_';
    }
    return out;
}

std::string jsonVector(const Vec3d& v) {
    return fmt::format("[{},{},{}]", v.x, v.y, v.z);
}

/// Text as it may stand between the quotes of a JSON string.
std::string jsonText(const std::string& text) {
    std::string out;
    for (const char c : text)
        if (c >= ' ' && c <= '~' && c != '"' && c != '\\') out += c;
    return out;
}

class GlbWriter : public MeshWriter {
public:
    GlbWriter(const std::string& path, bool force, const MeshOutput& output)
        : MeshWriter(output),
          path_(path),
          file_(path, force),
          out_(file_.file()),
          triangles_out_(path, out_) {
        stride_ = 12 + (output.schema.normals_given ? 12 : 0) + (output.schema.colours ? 4 : 0);
        scalars_ = std::min(output.schema.scalars.size(), (kLargestStride - stride_) / 4);
        stride_ += 4 * scalars_;
        // The longest that it can become, in multiples of four.
        const double widest = -std::numeric_limits<double>::max() / 3;
        bounds_.min = bounds_.max = Vec3f(-std::numeric_limits<float>::max() / 3);
        json_bytes_ = (json(UINT32_MAX, UINT32_MAX, Vec3d(widest)).size() + 3) / 4 * 4;
        bounds_ = {};
        checkCounts(output.expected_vertices, output.expected_triangles);
        out_.write(std::string(dataOffset(), ' '));
    }

    void endVertices() override { triangles_out_.join(); }

    void finish() override {
        endVertices();
        out_.flush();
        std::string text = json(vertexCount(), triangleCount(), output_.centre);
        CHECK_LE(text.size(), json_bytes_);
        text.resize(json_bytes_, ' ');
        const uint64_t data_bytes = out_.size() - dataOffset();
        std::vector<uint8_t> head(dataOffset());
        uint8_t* at = head.data();
        for (const uint64_t word : {uint64_t(kMagic), uint64_t(2), out_.size(),
                                    uint64_t(json_bytes_), uint64_t(kJsonChunk)})
            at = store(at, uint32_t(word));
        std::memcpy(at, text.data(), text.size());
        at += text.size();
        at = store(at, uint32_t(data_bytes));
        store(at, kDataChunk);
        file_.file().writeAt(0, head.data(), head.size());
        file_.commit();
    }

    std::vector<std::string> notes() const override {
        if (scalars_ == output_.schema.scalars.size()) return {};
        return {fmt::format("a GLB file holds {} of the {} scalar attributes", scalars_,
                            output_.schema.scalars.size())};
    }

protected:
    void checkCounts(uint64_t vertices, uint64_t triangles) const override {
        // note: the counts are bounded first so that the products cannot wrap.
        const bool few = vertices <= UINT32_MAX && triangles <= UINT32_MAX;
        if (!few || dataOffset() + vertices * stride_ + triangles * 12 > UINT32_MAX)
            throw UsageError(path_ + ": a GLB file holds at most 4 GiB; write a .ply instead");
    }

    void putVertices(const VertexBatch& batch) override {
        CHECK(!triangles_out_.joined());
        const size_t columns = output_.schema.scalars.size();
        for (size_t i = 0; i < batch.position.size(); ++i) {
            const Vec3f p(batch.position[i] - output_.centre);
            bounds_.add(p);
            uint8_t* out = store(out_.put(stride_), p);
            if (output_.schema.normals_given) out = store(out, batch.normal[i]);
            if (output_.schema.colours) out = store(out, batch.colour[i]);
            if (scalars_ > 0) std::memcpy(out, &batch.scalar[i * columns], 4 * scalars_);
        }
    }

    void putTriangles(std::span<const std::array<uint64_t, 3>> triangles) override {
        for (const auto& t : triangles) {
            uint8_t* out = triangles_out_.put(12);
            for (const uint64_t index : t) out = store(out, uint32_t(index));
        }
    }

private:
    size_t dataOffset() const { return kHeadBytes + 2 * kChunkHeadBytes + json_bytes_; }

    std::string json(uint64_t vertices, uint64_t triangles, const Vec3d& translation) const {
        const uint64_t vertex_bytes = vertices * stride_, index_bytes = triangles * 12;
        std::string attributes = "\"POSITION\":0", accessors;
        accessors += fmt::format(
            R"({{"bufferView":0,"componentType":5126,"count":{},"type":"VEC3","min":{},"max":{}}})",
            vertices, jsonVector(Vec3d(bounds_.min)), jsonVector(Vec3d(bounds_.max)));
        size_t offset = 12, count = 1;
        const auto add = [&](const std::string& name, int component, const char* type, size_t bytes,
                             const char* more) {
            attributes += fmt::format(",\"{}\":{}", name, count++);
            accessors += fmt::format(
                R"(,{{"bufferView":0,"byteOffset":{},"componentType":{},"count":{},"type":"{}"{}}})",
                offset, component, vertices, type, more);
            offset += bytes;
        };
        if (output_.schema.normals_given) add("NORMAL", 5126, "VEC3", 12, "");
        if (output_.schema.colours) add("COLOR_0", 5121, "VEC4", 4, ",\"normalized\":true");
        for (size_t i = 0; i < scalars_; ++i)
            add(attributeName(output_.schema.scalars[i]), 5126, "SCALAR", 4, "");
        accessors +=
            fmt::format(R"(,{{"bufferView":1,"componentType":5125,"count":{},"type":"SCALAR"}})",
                        triangles * 3);
        return fmt::format(
            R"({{"asset":{{"version":"2.0","generator":"{}"}},"scene":0,"scenes":[{{"nodes":[0]}}],)"
            R"("nodes":[{{"mesh":0,"translation":{}}}],)"
            R"("meshes":[{{"primitives":[{{"attributes":{{{}}},"indices":{},"mode":4}}]}}],)"
            R"("accessors":[{}],)"
            R"("bufferViews":[{{"buffer":0,"byteLength":{},"byteStride":{},"target":34962}},)"
            R"({{"buffer":0,"byteOffset":{},"byteLength":{},"target":34963}}],)"
            R"("buffers":[{{"byteLength":{}}}]}})",
            output_.comment.empty() ? "pietra" : jsonText(output_.comment), jsonVector(translation),
            attributes, count, accessors, vertex_bytes, stride_, vertex_bytes, index_bytes,
            vertex_bytes + index_bytes);
    }

    std::string path_;
    AtomicFile file_;
    OutputBuffer out_;
    size_t stride_ = 0;
    size_t scalars_ = 0;  ///< how many of them are written
    size_t json_bytes_ = 0;
    Box<Vec3f> bounds_;
    OutputTail triangles_out_;
};

}  // namespace

std::unique_ptr<MeshWriter> createGlb(const std::string& path, bool force,
                                      const MeshOutput& output) {
    return std::make_unique<GlbWriter>(path, force, output);
}

}  // namespace pietra
