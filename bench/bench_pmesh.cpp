// Active vertices by leaves (methods/pmesh/front) against the active mesh, in turn.
//
//   bench_front JOBS MESH...
//
// Printed for each mesh: refining all of it and coarsening it again; a view that hardly moves; and
// a camera that rushes to and fro, the best of some flights by processor time. Each frame until
// nothing is left to do.

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "base/parallel.h"
#include "clock.h"
#include "methods/pmesh/adaption.h"
#include "methods/pmesh/front/leaf_front.h"
#include "methods/pmesh/front/split_front.h"
#include "methods/pmesh/front/split_testing.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/whole_mesh.h"
#include "pmesh_views.h"

namespace {

using namespace pietra;
using namespace pietra::pmesh;

/// Of one body, over some frames.
struct Sum {
    uint64_t operations = 0, vertices = 0, faces = 0;
    uint32_t least = ~0u;
    double cpu = 0, wall = 0;
    template <class Frame>
    void add(Frame&& frame) {
        const double c = processSeconds(), w = wallSeconds();
        const uint32_t done = frame();
        cpu += processSeconds() - c;
        wall += wallSeconds() - w;
        operations += done;
        least = std::min(least, done);
    }
    void addSize(size_t vertex_count, size_t face_count) {
        vertices += vertex_count;
        faces += face_count;
    }
    void print(const char* name, int frames) const {
        std::printf("    %s: %8llu vertices %8llu faces %6llu operations (least %u):"
                    " %.2f M/s of processor, %.2f M/s\n",
                    name, static_cast<unsigned long long>(vertices / frames),
                    static_cast<unsigned long long>(faces / frames),
                    static_cast<unsigned long long>(operations / frames), least,
                    double(operations) / cpu * 1e-6, double(operations) / wall * 1e-6);
    }
};

void storm(LeafFront& front, const LeafForest& forest, ResidentSplits& nodes, SplitFront& split,
           const Box3d& box, double pixels) {
    const int frames = 24;
    std::array<Sum, 2> best;
    const auto camera = [&](int f) { return stormCamera(box, forest.lattice, f); };
    for (int round = 0; round < 6; ++round) {
        std::array<Sum, 2> sum;
        for (int f = 0; f <= frames; ++f) {
            if (f == 1) sum = {};
            const FrontView view = frontView(camera(f), forest, pixels);
            sum[0].add([&] { return front.adapt(view).operations(); });
            sum[0].addSize(front.vertexCount(), front.triangleCount());
        }
        for (int f = 0; f <= frames; ++f) {
            if (f == 1) sum[1] = {};
            const SplitView view =
                splitView(camera(f), forest.lattice, nodes.forest().grid, pixels);
            sum[1].add([&] {
                nodes.look(view);
                return split.adapt(view).operations();
            });
            sum[1].addSize(split.vertexCount(), split.triangleCount());
        }
        for (size_t i = 0; i < 2; ++i)
            if (round == 0 || sum[i].cpu < best[i].cpu) best[i] = sum[i];
    }
    std::printf("  storm at %.2f px\n", pixels);
    best[0].print("by leaves", frames);
    best[1].print("by splits", frames);
}

void hover(LeafFront& front, const LeafForest& forest, const Box3d& box, double pixels) {
    std::vector<double> ns;
    uint64_t operations = 0;
    const auto view = [&](int frame) {
        return frontView(cameraFrom(box, forest.lattice, 2 + 1e-5 * frame, 0.4), forest, pixels);
    };
    front.adapt(view(0));
    for (int frame = 1; frame <= 200; ++frame) {
        const FrontView v = view(frame);
        const double begin = processSeconds();
        operations += front.adapt(v).operations();
        ns.push_back((processSeconds() - begin) * 1e9 /
                     double(front.vertexCount()));
    }
    std::sort(ns.begin(), ns.end());
    std::printf("  hover at %.2f px: %zu vertices, %.1f operations a frame: median %.2f, 90 %% %.2f"
                " ns a vertex of processor time\n",
                pixels, front.vertexCount(), double(operations) / 200, ns[100], ns[180]);
}

void run(const char* path) {
    Budget budget(size_t(8) << 30);
    TempSpace space{"/tmp", &budget, size_t(1) << 30};
    Progress progress;
    const auto source = openSource({path});
    WholeMesh whole = readWholeMesh(*source, path, {}, space, progress);
    Box3d box;
    for (const Vec3i& p : whole.mesh.position) box.add(whole.lattice.toInput(p));
    const LeafForest forest = makeLeafForest(logCollapses(whole.mesh, whole.lattice, budget));
    std::printf("%s: %zu triangles, %zu leaves, %zu roots, %zu base triangles\n", path,
                whole.mesh.triangleCount(), forest.leaves(), forest.root.size(),
                forest.base_corner.size() / 3);
    LeafFront front(forest);
    for (int i = 0; i < 3; ++i)
        for (const bool all : {true, false}) {
            Sum sum;
            sum.add([&] { return front.adapt(wholeView(all)).operations(); });
            sum.addSize(front.vertexCount(), front.triangleCount());
            sum.print(all ? "refine all " : "coarsen all", 1);
        }
    for (const double pixels : {1.0, 0.25, 0.1}) hover(front, forest, box, pixels);
    SplitForest packed = ForestPacker(forest).pack();
    const std::vector<SplitNode> node = packed.node;
    ResidentSplits nodes(std::move(packed), ~0u);
    for (NodeIndex n = 0; n < node.size(); ++n)
        if (nodes.forest().row[n].parent != kNoNode && !nodes.arrive(n, node[n])) std::abort();
    SplitFront split(nodes);
    for (int i = 0; i < 3; ++i)
        for (const bool all : {true, false}) {
            Sum sum;
            sum.add([&] {
                nodes.look(wholeSplitView(all));
                return split.adapt(wholeSplitView(all)).operations();
            });
            sum.addSize(split.vertexCount(), split.triangleCount());
            sum.print(all ? "splits: refine all " : "splits: coarsen all", 1);
        }
    for (const double pixels : {1.0, 0.25, 0.1}) {
        std::vector<double> ns;
        for (int frame = 0; frame <= 200; ++frame) {
            const SplitView v = splitView(cameraFrom(box, forest.lattice, 2 + 1e-5 * frame, 0.4),
                                          forest.lattice, nodes.forest().grid, pixels);
            const double begin = processSeconds();
            nodes.look(v);
            split.adapt(v);
            ns.push_back((processSeconds() - begin) * 1e9 / double(split.vertexCount()));
        }
        std::sort(ns.begin(), ns.end());
        std::printf("  splits: hover at %.2f px: %zu vertices: median %.2f ns a vertex\n", pixels,
                    split.vertexCount(), ns[100]);
    }
    for (const double pixels : {1.0, 0.25, 0.1}) storm(front, forest, nodes, split, box, pixels);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        std::fprintf(stderr, "usage: bench_front JOBS MESH...\n");
        return 2;
    }
    const ThreadLimit limit(std::atoi(argv[1]));
    for (int i = 2; i < argc; ++i) run(argv[i]);
}
