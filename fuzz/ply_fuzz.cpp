// libFuzzer target: whatever the bytes, the PLY reader gives finite vertices and valid indices, or an
// InputError; it neither crashes, hangs nor takes memory that the bytes do not back.

#include <cmath>
#include <cstdlib>

#include "base/error.h"
#include "io/ply_source.h"

using namespace pietra;

namespace {

void require(bool condition) {
    if (!condition) std::abort();
}

void readAll(TriangleSource& source) {
    VertexBatch vertices;
    uint64_t vertex_count = 0;
    source.rewindVertices();
    while (source.readVertices(vertices)) {
        require(vertices.first == vertex_count);
        vertex_count += vertices.position.size();
        for (const Vec3d& p : vertices.position)
            require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
        require(vertices.scalar.size() ==
                vertices.position.size() * source.schema().scalars.size());
    }
    require(vertex_count == source.vertexCount());
    TriangleBatch triangles;
    source.rewindTriangles();
    while (source.readTriangles(triangles)) {
        require(triangles.triangle.size() <= kMaxBatch);
        for (const auto& t : triangles.triangle)
            for (const uint64_t index : t) require(index < vertex_count);
    }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    try {
        auto bytes = bytesInMemory("fuzz", std::vector<uint8_t>(data, data + size));
        const auto source = openPly(std::make_unique<ByteReader>(std::move(bytes)));
        readAll(*source);
        readAll(*source);
    } catch (const InputError&) {
    }
    return 0;
}
