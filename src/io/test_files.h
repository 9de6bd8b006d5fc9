#pragma once
// Helpers of the tests in src/io: whole meshes, the shared data.

#include <gtest/gtest.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <sstream>
#include <string>

#include "base/budget.h"
#include "base/error.h"
#include "base/scratch_directory.h"
#include "io/triangle_source.h"

namespace pietra {

inline std::string readWholeFile(const std::string& path) {
    std::ostringstream text;
    text << std::ifstream(path, std::ios::binary).rdbuf();
    return text.str();
}

/// All that a source gives, in one piece.
struct WholeMesh {
    AttributeSchema schema;
    VertexBatch vertices;
    std::vector<std::array<uint64_t, 3>> triangles;
    std::vector<std::string> notes;
};

inline WholeMesh readWhole(TriangleSource& source) {
    WholeMesh mesh;
    mesh.schema = source.schema();
    VertexBatch vertices;
    const auto append = [](auto& to, const auto& from) {
        to.insert(to.end(), from.begin(), from.end());
    };
    source.rewindVertices();
    while (source.readVertices(vertices)) {
        EXPECT_EQ(vertices.first, mesh.vertices.position.size());
        append(mesh.vertices.position, vertices.position);
        append(mesh.vertices.normal, vertices.normal);
        append(mesh.vertices.colour, vertices.colour);
        append(mesh.vertices.scalar, vertices.scalar);
    }
    EXPECT_EQ(mesh.vertices.position.size(), source.vertexCount());
    TriangleBatch triangles;
    source.rewindTriangles();
    while (source.readTriangles(triangles)) {
        EXPECT_EQ(triangles.first, mesh.triangles.size());
        append(mesh.triangles, triangles.triangle);
    }
    mesh.notes = source.notes();
    return mesh;
}

inline WholeMesh readWhole(const std::string& path) {
    return readWhole(*openSource({path}));
}

/// The corners of triangles, which do not know of each other.
using Soup = std::vector<std::array<Vec3d, 3>>;

inline Soup soupOf(const WholeMesh& mesh) {
    Soup soup;
    for (const auto& t : mesh.triangles)
        soup.push_back({mesh.vertices.position[t[0]], mesh.vertices.position[t[1]],
                        mesh.vertices.position[t[2]]});
    return soup;
}

inline void expectSameMesh(const WholeMesh& a, const WholeMesh& b) {
    EXPECT_EQ(a.schema, b.schema);
    EXPECT_EQ(a.vertices.position, b.vertices.position);
    EXPECT_EQ(a.vertices.normal, b.vertices.normal);
    EXPECT_EQ(a.vertices.colour, b.vertices.colour);
    EXPECT_EQ(a.vertices.scalar, b.vertices.scalar);
    EXPECT_EQ(a.triangles, b.triangles);
}

/// What opening and reading a file fails with, or "" if it does not.
inline std::string faultOf(const std::string& path) {
    try {
        readWhole(path);
        return "";
    } catch (const Error& e) {
        return e.what();
    }
}

/// What the address sanitizer keeps of freed memory for a while may be taken for growth.
enum class FreedMemory { kCounts, kIsSpared };

/// The number of triangles of the files, which are opened and read once. The process must take no
/// more than `megabytes` for that, beside what it had.
inline uint64_t trianglesReadWithin(int megabytes, const std::vector<std::string>& paths,
                                    [[maybe_unused]] FreedMemory freed = FreedMemory::kCounts) {
    const size_t before = residentBytes();
    const auto source = openSource(paths);
    size_t most = 0;
    uint64_t count = 0;
    VertexBatch vertices;
    TriangleBatch triangles;
    while (source->readVertices(vertices)) most = std::max(most, residentBytes());
    while (source->readTriangles(triangles)) {
        most = std::max(most, residentBytes());
        count += triangles.triangle.size();
    }
#ifdef __SANITIZE_ADDRESS__
    if (freed == FreedMemory::kIsSpared) return count;
#endif
    EXPECT_LT(most, before + (size_t(megabytes) << 20)) << paths[0];
    return count;
}

/// The bytes of a gzip file that holds `text`.
inline std::string gzipped(const std::string& text) {
    std::string out(text.size() + 1000, '\0');
    z_stream stream{};
    deflateInit2(&stream, 1, Z_DEFLATED, 15 + 16, 8, Z_DEFAULT_STRATEGY);
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
    stream.avail_in = uInt(text.size());
    stream.next_out = reinterpret_cast<Bytef*>(out.data());
    stream.avail_out = uInt(out.size());
    EXPECT_EQ(deflate(&stream, Z_FINISH), Z_STREAM_END);
    out.resize(stream.total_out);
    deflateEnd(&stream);
    return out;
}

/// A file of the data for development, which lies beside the checkout or where PIETRA_SHARED says;
/// "" where it is absent.
inline std::string sharedData(const std::string& name) {
    namespace fs = std::filesystem;
    const char* given = std::getenv("PIETRA_SHARED");
    const fs::path root = fs::path(__FILE__).parent_path().parent_path().parent_path();
    const fs::path shared = given ? fs::path(given) : root.parent_path() / "shared";
    const fs::path path = shared / "data" / name;
    return fs::exists(path) ? path.string() : "";
}

}  // namespace pietra
