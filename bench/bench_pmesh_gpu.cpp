// Adaption of progressive meshes on the GPU (methods/pmesh/gl), all nodes in its memory.
//
//   bench_pmesh_gpu MESH...
//
// Printed for each mesh: refining all of it and coarsening it again, and a camera that rushes to
// and fro, each frame until nothing is left to do and the GPU has said so. The best of some flights.

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "clock.h"
#include "gpu/context.h"
#include "methods/pmesh/gl/gl_split_front.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/whole_mesh.h"
#include "pmesh_views.h"

namespace {

using namespace pietra;
using namespace pietra::pmesh;

void print(const char* name, uint64_t operations, size_t vertices, int frames, double seconds) {
    std::printf("  %s: %zu vertices, %llu operations a frame, %.1f M/s, %.3f ms\n", name, vertices,
                static_cast<unsigned long long>(operations / unsigned(frames)),
                double(operations) / seconds * 1e-6, seconds / frames * 1e3);
}

void storm(ResidentSplits& nodes, GlSplitFront& front, const Box3d& box, double pixels) {
    constexpr int kFrames = 24;
    double best = 1e9;
    uint64_t operations = 0;
    size_t vertices = 0;
    for (int round = 0; round < 6; ++round) {
        double seconds = 0;
        for (int f = 0; f <= kFrames; ++f) {
            if (f == 1) seconds = 0, operations = 0, vertices = 0;
            const SplitForest& forest = nodes.forest();
            const SplitView view = splitView(stormCamera(box, forest.lattice, f), forest.lattice,
                                             forest.grid, pixels);
            nodes.look(view);
            const double begin = wallSeconds();
            operations += front.adapt(view).operations();
            seconds += wallSeconds() - begin;
            vertices += front.vertexCount();
        }
        best = std::min(best, seconds);
    }
    char name[32];
    std::snprintf(name, sizeof name, "storm at %.2f px", pixels);
    print(name, operations, vertices / kFrames, kFrames, best);
}

void run(const char* path) {
    Budget budget(size_t(16) << 30);
    TempSpace space{"/tmp", &budget, size_t(1) << 30};
    Progress progress;
    const auto source = openSource({path});
    WholeMesh whole = readWholeMesh(*source, path, {}, space, progress);
    Box3d box;
    for (const Vec3i& p : whole.mesh.position) box.add(whole.lattice.toInput(p));
    SplitForest forest = buildInCore(std::move(whole.mesh), whole.lattice, budget);
    const std::vector<SplitNode> node = forest.node;
    const auto count = uint32_t(node.size());
    ResidentSplits nodes(std::move(forest), count);
    for (NodeIndex n = 0; n < count; ++n)
        if (nodes.forest().row[n].parent != kNoNode && !nodes.arrive(n, node[n])) std::abort();
    GlSplitFront front(nodes, count);
    std::printf("%s: %u nodes\n", path, count);
    for (const bool all : {true, false, true, false}) {
        nodes.look(wholeSplitView(all));
        const double begin = wallSeconds();
        const uint32_t operations = front.adapt(wholeSplitView(all)).operations();
        print(all ? "refine all" : "coarsen all", operations, front.vertexCount(), 1,
              wallSeconds() - begin);
    }
    for (const double pixels : {1.0, 0.25, 0.1}) storm(nodes, front, box, pixels);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 2) {
        std::fprintf(stderr, "usage: bench_pmesh_gpu MESH...\n");
        return 2;
    }
    const GlContext context = GlContext::headless();
    std::printf("%s\n", context.renderer().c_str());
    for (int i = 1; i < argc; ++i) run(argv[i]);
}
