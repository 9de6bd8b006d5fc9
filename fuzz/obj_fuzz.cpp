// libFuzzer target: whatever the bytes, the OBJ reader gives finite vertices and valid indices, or
// an InputError, the same each time and whatever the size of its blocks; it neither crashes, hangs
// nor takes memory that the bytes do not back.

#include <cmath>
#include <cstdlib>
#include <string>

#include "base/error.h"
#include "io/obj_source.h"

using namespace pietra;

namespace {

void require(bool condition) {
    if (!condition) std::abort();
}

void readVertices(TriangleSource& source, VertexBatch& all) {
    VertexBatch batch;
    source.rewindVertices();
    while (source.readVertices(batch)) {
        const size_t count = batch.position.size();
        require(batch.first == all.position.size() && count <= kMaxBatch);
        require(batch.colour.size() == (source.schema().colours ? count : 0));
        require(batch.normal.size() == (source.schema().normals_given ? count : 0));
        for (const Vec3d& p : batch.position) {
            require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
            all.position.push_back(p);
        }
        all.colour.insert(all.colour.end(), batch.colour.begin(), batch.colour.end());
    }
    require(all.position.size() == source.vertexCount());
}

struct Outcome {
    VertexBatch vertices;
    std::vector<std::array<uint64_t, 3>> triangles;
    std::string fault;
};

Outcome readAll(TriangleSource& source) {
    Outcome outcome;
    try {
        readVertices(source, outcome.vertices);
        TriangleBatch batch;
        source.rewindTriangles();
        while (source.readTriangles(batch)) {
            require(batch.first == outcome.triangles.size() && batch.triangle.size() <= kMaxBatch);
            for (const auto& t : batch.triangle) {
                for (const uint64_t index : t) require(index < source.vertexCount());
                outcome.triangles.push_back(t);
            }
        }
        require(!outcome.triangles.empty());
    } catch (const InputError& e) {
        outcome.fault = e.what();
    }
    return outcome;
}

void requireSame(const Outcome& a, const Outcome& b) {
    require(a.fault == b.fault);
    if (!a.fault.empty()) return;
    require(a.vertices.position == b.vertices.position);
    require(a.vertices.colour == b.vertices.colour);
    require(a.triangles == b.triangles);
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
    const auto open = [&](uint64_t block_bytes) {
        auto bytes = bytesInMemory("fuzz", std::vector<uint8_t>(data, data + size));
        return openObjInBlocks(std::make_unique<ByteReader>(std::move(bytes)), block_bytes);
    };
    try {
        const auto source = open(1 << 18);
        const Outcome first = readAll(*source);
        requireSame(first, readAll(*source));
        requireSame(first, readAll(*open(1)));
    } catch (const InputError&) {
    }
    return 0;
}
