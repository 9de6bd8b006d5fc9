// Reads one mesh file with one reader and says what it took:
//   bench_readers READER FILE            e.g. bench_readers pietra a.obj
//   bench_readers --list                 the readers of this build, with the endings they take
//   bench_readers --ascii IN OUT         writes the mesh IN as ascii PLY or STL, by OUT's ending
// Prints "TRIANGLES CHECKSUM SECONDS CPU_SECONDS PEAK_RSS_BYTES". One reading a process, so that
// the peak is its own; readers.py runs readers in turn. A reader is one function and one line in
// the table.

#include <fmt/format.h>
#include <fmt/os.h>
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

/// Adds x(0), x(1), ...: in four sums, as one would make every reader wait for it.
template <class X>
double sumOf(size_t count, X&& x) {
    double sum[4] = {};
    for (size_t i = 0; i < count; ++i) sum[i % 4] += double(x(i));
    return sum[0] + sum[1] + sum[2] + sum[3];
}

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
            outcome.sum +=
                sumOf(vertices.position.size(), [&](size_t i) { return vertices.position[i].x; });
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
    outcome.sum =
        sumOf(attributes.vertices.size() / 3, [&](size_t i) { return attributes.vertices[3 * i]; });
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
        outcome.sum += sumOf(mesh.mNumVertices, [&](size_t i) { return mesh.mVertices[i].x; });
    }
    return outcome;
}
#endif

/// Calls take(batch) for all vertices of a source, or all triangles.
template <class Take>
void eachVertices(TriangleSource& source, Take&& take) {
    source.rewindVertices();
    for (VertexBatch batch; source.readVertices(batch);) take(batch);
}
template <class Take>
void eachTriangles(TriangleSource& source, Take&& take) {
    source.rewindTriangles();
    for (TriangleBatch batch; source.readTriangles(batch);) take(batch);
}

void writeAsciiPly(TriangleSource& source, fmt::ostream& out) {
    uint64_t triangles = 0;
    eachTriangles(source, [&](const TriangleBatch& batch) { triangles += batch.triangle.size(); });
    out.print(
        "ply\nformat ascii 1.0\nelement vertex {}\nproperty float x\nproperty float y\n"
        "property float z\nelement face {}\nproperty list uchar int vertex_indices\nend_header\n",
        source.vertexCount(), triangles);
    eachVertices(source, [&](const VertexBatch& batch) {
        for (const Vec3f p : batch.position) out.print("{} {} {}\n", p.x, p.y, p.z);
    });
    eachTriangles(source, [&](const TriangleBatch& batch) {
        for (const auto& t : batch.triangle) out.print("3 {} {} {}\n", t[0], t[1], t[2]);
    });
}

void writeAsciiStl(TriangleSource& source, fmt::ostream& out) {
    std::vector<Vec3f> position;
    eachVertices(source, [&](const VertexBatch& batch) {
        position.insert(position.end(), batch.position.begin(), batch.position.end());
    });
    out.print("solid mesh\n");
    eachTriangles(source, [&](const TriangleBatch& batch) {
        for (const auto& t : batch.triangle) {
            const Vec3f a = position[t[0]], b = position[t[1]], c = position[t[2]];
            const Vec3f n = glm::normalize(glm::cross(b - a, c - a));
            out.print("  facet normal {} {} {}\n    outer loop\n", n.x, n.y, n.z);
            for (const Vec3f& p : {a, b, c}) out.print("      vertex {} {} {}\n", p.x, p.y, p.z);
            out.print("    endloop\n  endfacet\n");
        }
    });
    out.print("endsolid mesh\n");
}

int writeAscii(const std::string& in, const std::string& path) {
    const auto source = openSource({in});
    auto out = fmt::output_file(path);
    (path.ends_with(".stl") ? writeAsciiStl : writeAsciiPly)(*source, out);
    return 0;
}

struct Reader {
    const char* name;
    const char* endings;
    Outcome (*read)(const std::string& path);
};

constexpr Reader kReaders[] = {
    {"pietra", ".obj .ply .stl .glb", readOnce},
    {"pietra-build", ".obj .ply .stl .glb", readAsBuild},
#ifdef PIETRA_BENCH_TINYOBJ
    {"tinyobjloader", ".obj", readTinyObj},
#endif
#ifdef PIETRA_BENCH_ASSIMP
    {"assimp", ".obj .ply .stl .glb", readAssimp},
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
        if (argc == 4 && std::strcmp(argv[1], "--ascii") == 0) return writeAscii(argv[2], argv[3]);
        for (const Reader& reader : kReaders)
            if (argc == 3 && std::strcmp(argv[1], reader.name) == 0) return run(reader, argv[2]);
    } catch (const Error& e) {
        fmt::print(stderr, "{}\n", e.what());
        return e.exitCode();
    }
    fmt::print(stderr, "usage: bench_readers READER FILE | --list | --ascii IN OUT\n");
    return 2;
}
