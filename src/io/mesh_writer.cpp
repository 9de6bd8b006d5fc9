#include "io/mesh_writer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>

#include "base/check.h"
#include "base/error.h"
#include "io/mesh_writers.h"

namespace pietra {

namespace {

struct WriterRow {
    const char* ending;
    std::unique_ptr<MeshWriter> (*create)(const std::string&, bool, const MeshOutput&);
};
constexpr WriterRow kWriters[] = {
    {".ply", createPly}, {".obj", createObj}, {".stl", createStl}, {".glb", createGlb}};

}  // namespace

std::unique_ptr<MeshWriter> createMesh(const std::string& path, bool force,
                                       const MeshOutput& output) {
    std::string ending = std::filesystem::path(path).extension().string();
    for (char& c : ending) c = char(std::tolower(static_cast<unsigned char>(c)));
    for (const WriterRow& row : kWriters)
        if (ending == row.ending) return row.create(path, force, output);
    throw UsageError(fmt::format("{}: the name of a mesh ends in .ply, .obj, .stl or .glb", path));
}

void MeshWriter::addVertices(const VertexBatch& batch) {
    const size_t count = batch.position.size();
    CHECK_EQ(batch.normal.size(), output_.schema.normals_given ? count : 0);
    CHECK_EQ(batch.colour.size(), output_.schema.colours ? count : 0);
    CHECK_EQ(batch.scalar.size(), output_.schema.scalars.size() * count);
    vertices_ += count;
    checkCounts(vertices_, triangles_);
    putVertices(batch);
}

void MeshWriter::addTriangles(std::span<const std::array<uint64_t, 3>> triangles) {
    uint64_t last = 0;
    for (const auto& t : triangles) last = std::max({last, t[0], t[1], t[2]});
    if (!triangles.empty()) CHECK_LT(last, vertices_);
    triangles_ += triangles.size();
    checkCounts(vertices_, triangles_);
    putTriangles(triangles);
}

bool needsDoubles(const Box3d& bounds, double step) {
    double largest = 0;
    for (int k = 0; k < 3; ++k)
        largest = std::max({largest, std::abs(bounds.min[k]), std::abs(bounds.max[k])});
    return largest * 0x1p-24 > step / 4;
}

File temporaryBeside(const std::string& output_path) {
    const auto directory = std::filesystem::path(output_path).parent_path();
    return File(directory.empty() ? "." : directory.string(), File::Mode::kTemporary);
}

void OutputTail::open() {
    file_ = temporaryBeside(output_path_);
    waiting_.emplace(file_);
}

void OutputTail::join() {
    joined_ = true;
    if (!waiting_) return;
    waiting_->flush();
    const uint64_t bytes = waiting_->size();
    for (uint64_t at = 0; at < bytes;) {
        const auto n = size_t(std::min<uint64_t>(bytes - at, OutputBuffer::kLargestPut));
        file_.readAt(at, main_.put(n), n);
        at += n;
    }
    waiting_.reset();
    file_.close();
}

}  // namespace pietra
