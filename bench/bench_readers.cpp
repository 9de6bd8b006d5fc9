// Reads one mesh file with one reader and says what it took:
//   bench_readers READER FILE            e.g. bench_readers pietra a.obj
//   bench_readers --list                 the readers of this build, with the endings they take
// Prints "TRIANGLES CHECKSUM SECONDS CPU_SECONDS PEAK_RSS_BYTES". One reading a process, so that
// the peak is its own; readers.py runs readers in turn. A reader is one function and one line in
// the table.

#include <fmt/format.h>
#include <sys/resource.h>

#include <chrono>
#include <cstdio>
#include <cstring>

#include "base/budget.h"
#include "base/error.h"
#include "io/triangle_source.h"

#ifdef PIETRA_BENCH_TINYOBJ
#define TINYOBJLOADER_IMPLEMENTATION
#pragma GCC diagnostic push
#pragma GCC diagnostic ignored "-Wconversion"
#include <tiny_obj_loader.h>
#pragma GCC diagnostic pop
#endif
#ifdef PIETRA_BENCH_ASSIMP
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <assimp/Importer.hpp>
#endif

namespace pietra {
namespace {

/// What all readers must agree about, where the file keeps vertices apart: the sum is of the x of
/// the corners of all triangles.
struct Outcome {
    uint64_t triangles = 0;
    double sum = 0;
};

/// `times` over each stream: a build reads vertices twice and triangles about as often.
Outcome readTimes(const std::string& path, int times) {
    const auto source = openSource({path});
    Outcome outcome;
    VertexBatch vertices;
    TriangleBatch triangles;
    for (int i = 0; i < times; ++i) {
        outcome = {};
        source->rewindVertices();
        while (source->readVertices(vertices))
            for (const Vec3d& p : vertices.position) outcome.sum += p.x;
        source->rewindTriangles();
        while (source->readTriangles(triangles)) outcome.triangles += triangles.triangle.size();
    }
    return outcome;
}

Outcome readOnce(const std::string& path) {
    return readTimes(path, 1);
}
Outcome readAsBuild(const std::string& path) {
    return readTimes(path, 2);
}

#ifdef PIETRA_BENCH_TINYOBJ
Outcome readTinyObj(const std::string& path) {
    tinyobj::attrib_t attributes;
    std::vector<tinyobj::shape_t> shapes;
    std::vector<tinyobj::material_t> materials;
    std::string warning, fault;
    if (!tinyobj::LoadObj(&attributes, &shapes, &materials, &warning, &fault, path.c_str()))
        throw InputError(path, "", fault);
    Outcome outcome;
    for (size_t i = 0; i < attributes.vertices.size(); i += 3)
        outcome.sum += double(attributes.vertices[i]);
    for (const tinyobj::shape_t& shape : shapes)
        outcome.triangles += shape.mesh.num_face_vertices.size();
    return outcome;
}
#endif

#ifdef PIETRA_BENCH_ASSIMP
/// Without joining equal vertices, which is not reading.
Outcome readAssimp(const std::string& path) {
    Assimp::Importer importer;
    const aiScene* const scene = importer.ReadFile(path, aiProcess_Triangulate);
    if (!scene) throw InputError(path, "", importer.GetErrorString());
    Outcome outcome;
    for (unsigned m = 0; m < scene->mNumMeshes; ++m) {
        const aiMesh& mesh = *scene->mMeshes[m];
        outcome.triangles += mesh.mNumFaces;
        for (unsigned v = 0; v < mesh.mNumVertices; ++v) outcome.sum += double(mesh.mVertices[v].x);
    }
    return outcome;
}
#endif

struct Reader {
    const char* name;
    const char* endings;
    Outcome (*read)(const std::string& path);
};

constexpr Reader kReaders[] = {
    {"pietra", ".obj .ply", readOnce},
    {"pietra-build", ".obj .ply", readAsBuild},
#ifdef PIETRA_BENCH_TINYOBJ
    {"tinyobjloader", ".obj", readTinyObj},
#endif
#ifdef PIETRA_BENCH_ASSIMP
    {"assimp", ".obj .ply", readAssimp},
#endif
};

double cpuSeconds() {
    rusage usage{};
    getrusage(RUSAGE_SELF, &usage);
    const auto seconds = [](const timeval& t) {
        return double(t.tv_sec) + double(t.tv_usec) * 1e-6;
    };
    return seconds(usage.ru_utime) + seconds(usage.ru_stime);
}

int run(const Reader& reader, const std::string& path) {
    const auto begin = std::chrono::steady_clock::now();
    const double cpu_begin = cpuSeconds();
    const Outcome outcome = reader.read(path);
    const double cpu = cpuSeconds() - cpu_begin;
    const double seconds =
        std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    fmt::print("{} {:.4f} {:.4f} {:.4f} {}\n", outcome.triangles, outcome.sum, seconds, cpu,
               peakResidentBytes());
    return 0;
}

}  // namespace
}  // namespace pietra

int main(int argc, char** argv) {
    using namespace pietra;
    if (argc == 2 && std::strcmp(argv[1], "--list") == 0) {
        for (const Reader& reader : kReaders) fmt::print("{} {}\n", reader.name, reader.endings);
        return 0;
    }
    try {
        for (const Reader& reader : kReaders)
            if (argc == 3 && std::strcmp(argv[1], reader.name) == 0) return run(reader, argv[2]);
    } catch (const Error& e) {
        fmt::print(stderr, "{}\n", e.what());
        return e.exitCode();
    }
    fmt::print(stderr, "usage: bench_readers READER FILE | --list\n");
    return 2;
}
