// Binary little-endian PLY. The header is as long as the largest counts would make it and is filled
// in at the end; a comment takes up the slack.

#include <fmt/format.h>

#include <limits>

#include "base/check.h"
#include "base/error.h"
#include "io/mesh_writers.h"

namespace pietra {

namespace {

/// A name as it may stand in a header: no blanks, no control characters.
std::string propertyName(std::string name) {
    for (char& c : name)
        if (c <= ' ' || c > '~') c = '_';
    return name.empty() ? "_" : name;
}

class PlyWriter : public MeshWriter {
public:
    PlyWriter(const std::string& path, bool force, const MeshOutput& output)
        : MeshWriter(output),
          path_(path),
          file_(path, force),
          out_(file_.file()),
          triangles_out_(path, out_) {
        checkCounts(output.expected_vertices, output.expected_triangles);
        header_bytes_ =
            header(std::numeric_limits<uint64_t>::max(), std::numeric_limits<uint64_t>::max())
                .size() +
            kCommentBytes;
        out_.write(std::string(header_bytes_, ' '));
    }

    void endVertices() override { triangles_out_.join(); }

    void finish() override {
        endVertices();
        out_.flush();
        std::string text = header(vertexCount(), triangleCount());
        const size_t slack = header_bytes_ - text.size() - kCommentBytes;
        const std::string filler = "comment" + std::string(slack, ' ') + "\n";
        CHECK_EQ(filler.size(), slack + kCommentBytes);
        text.insert(text.find('\n', text.find("format")) + 1, filler);
        file_.file().writeAt(0, text.data(), text.size());
        file_.commit();
    }

protected:
    void checkCounts(uint64_t vertices, uint64_t) const override {
        if (vertices > uint64_t(1) << 32)
            throw UsageError(path_ +
                             ": a PLY file with 32-bit indices holds at most 2^32 vertices");
    }

    void putVertices(const VertexBatch& batch) override {
        CHECK(!triangles_out_.joined());
        const size_t scalars = output_.schema.scalars.size();
        const size_t stride = (output_.double_positions ? 24 : 12) +
                              (output_.schema.normals_given ? 12 : 0) +
                              (output_.schema.colours ? 4 : 0) + 4 * scalars;
        for (size_t i = 0; i < batch.position.size(); ++i) {
            uint8_t* out = out_.put(stride);
            if (output_.double_positions)
                out = store(out, batch.position[i]);
            else
                out = store(out, Vec3f(batch.position[i]));
            if (output_.schema.normals_given) out = store(out, batch.normal[i]);
            if (output_.schema.colours) out = store(out, batch.colour[i]);
            if (scalars > 0) std::memcpy(out, &batch.scalar[i * scalars], 4 * scalars);
        }
    }

    void putTriangles(std::span<const std::array<uint64_t, 3>> triangles) override {
        for (const auto& t : triangles) {
            uint8_t* out = store(triangles_out_.put(13), uint8_t(3));
            for (const uint64_t index : t) out = store(out, uint32_t(index));
        }
    }

private:
    static constexpr size_t kCommentBytes = sizeof("comment\n") - 1;

    std::string header(uint64_t vertices, uint64_t triangles) const {
        std::string text = "ply\nformat binary_little_endian 1.0\n";
        if (!output_.comment.empty()) text += "comment " + output_.comment + "\n";
        text += fmt::format("element vertex {}\n", vertices);
        const auto property = [&](const char* type, const std::string& name) {
            text += fmt::format("property {} {}\n", type, name);
        };
        for (const char* name : {"x", "y", "z"})
            property(output_.double_positions ? "double" : "float", name);
        if (output_.schema.normals_given)
            for (const char* name : {"nx", "ny", "nz"}) property("float", name);
        if (output_.schema.colours)
            for (const char* name : {"red", "green", "blue", "alpha"}) property("uchar", name);
        for (const std::string& name : output_.schema.scalars)
            property("float", propertyName(name));
        // note: most readers know signed indices only, so unsigned ones where nothing else will do.
        const bool large = vertices > uint64_t(1) << 31;
        text += fmt::format("element face {}\nproperty list uchar {} vertex_indices\nend_header\n",
                            triangles, large ? "uint" : "int");
        return text;
    }

    std::string path_;
    AtomicFile file_;
    OutputBuffer out_;
    size_t header_bytes_ = 0;
    OutputTail triangles_out_;
};

}  // namespace

std::unique_ptr<MeshWriter> createPly(const std::string& path, bool force,
                                      const MeshOutput& output) {
    return std::make_unique<PlyWriter>(path, force, output);
}

}  // namespace pietra
