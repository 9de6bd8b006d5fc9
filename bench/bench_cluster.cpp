// Face-cluster layers: what they cost, and how far they are from the input.
//
//   bench_cluster JOBS CELL_VERTICES MESH...

#include <time.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <random>

#include "base/parallel.h"
#include "io/triangle_source.h"
#include "methods/cluster/layers.h"
#include "simplify/test_meshes.h"

namespace {

using namespace pietra;
using namespace pietra::cluster;

/// Processor time of all threads: the machine may be shared.
double now() {
    timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return double(t.tv_sec) + double(t.tv_nsec) * 1e-9;
}

Mesh readMesh(const char* path) {
    const auto source = openSource({path});
    test::Shape shape;
    VertexBatch vertices;
    for (source->rewindVertices(); source->readVertices(vertices);)
        shape.position.insert(shape.position.end(), vertices.position.begin(),
                              vertices.position.end());
    TriangleBatch triangles;
    for (source->rewindTriangles(); source->readTriangles(triangles);)
        for (const auto& [a, b, c] : triangles.triangle)
            shape.triangle.push_back({uint32_t(a), uint32_t(b), uint32_t(c)});
    return test::toLattice(shape, (1 << 21) - 4096);
}

/// Of every cell the coarsest layer whose stated error is at most this, and the strips.
size_t trianglesAt(const LayeredPiece& piece, float error) {
    std::vector<uint16_t> choice;
    for (const CellLayers& cell : piece.cell)
        choice.push_back(uint16_t(std::upper_bound(cell.error.begin(), cell.error.end(), error) -
                                  1 - cell.error.begin()));
    return mixedMesh(piece, choice).triangleCount();
}

}  // namespace

int main(int count, char** arguments) {
    if (count < 4) {
        std::fprintf(stderr, "usage: bench_cluster JOBS CELL_VERTICES MESH...\n");
        return 2;
    }
    const ThreadLimit limit(std::atoi(arguments[1]));
    for (int i = 3; i < count; ++i) {
        const Mesh mesh = readMesh(arguments[i]);
        LayerSettings settings;
        settings.cell_vertices = uint32_t(std::atoi(arguments[2]));
        const double begin = now();
        const LayeredPiece piece = buildLayers(mesh, settings);
        const double seconds = now() - begin;
        std::printf("%s: %zu triangles, %zu cells, %zu strips; %.2f s, %.0f k triangles/s\n",
                    arguments[i], mesh.triangleCount(), piece.cell.size(), piece.strips.size(),
                    seconds, 1e-3 * double(mesh.triangleCount()) / seconds);
        std::printf(
            "  cells %.2f s, interfaces %.2f s, faces and triangles %.2f s, errors %.2f s\n",
            piece.seconds.cells, piece.seconds.interfaces, piece.seconds.faces,
            piece.seconds.errors);
        for (uint16_t layer = 0; layer <= piece.layers; ++layer) {
            size_t triangles = 0, stars = 0, free_points = 0;
            for (const CellLayers& cell : piece.cell) {
                triangles += cell.layer[layer].mesh.triangleCount();
                stars += cell.layer[layer].stars;
                free_points += cell.layer[layer].to_free.size();
            }
            std::vector<float> errors;
            for (const CellLayers& cell : piece.cell) errors.push_back(cell.error[layer]);
            std::sort(errors.begin(), errors.end());
            const auto strips =
                std::count_if(piece.strips.begin(), piece.strips.end(),
                              [&](const Strip& strip) { return strip.layer == layer; });
            std::printf(
                "  layer %u: %zu triangles, %zu stars, %zu free points, %zu strips; a cell's error:"
                " median %.1f, most %.1f\n",
                layer, triangles, stars, free_points, size_t(strips),
                double(errors[errors.size() / 2]), double(errors.back()));
        }
        std::printf("  triangles at stated errors of");
        for (const float error : {1e3f, 3e3f, 1e4f, 3e4f, 1e5f})
            std::printf(" %.0f: %zu%s", double(error), trianglesAt(piece, error),
                        error < 1e5f ? "," : "\n");
    }
}
