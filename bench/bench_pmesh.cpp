// Adaption of progressive meshes (methods/pmesh/front), all nodes in memory.
//
//   bench_pmesh JOBS MESH...
//
// Printed for each mesh: refining all of it and coarsening it again; a view that hardly moves; and
// a camera that rushes to and fro, the best of some flights by processor time. Each frame until
// nothing is left to do; with chunks: also what is drawn is made anew.

#include <algorithm>
#include <cstdio>
#include <cstdlib>

#include "base/parallel.h"
#include "clock.h"
#include "methods/pmesh/front/split_chunks.h"
#include "methods/pmesh/front/split_front.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/split_codec.h"
#include "methods/pmesh/whole_mesh.h"
#include "pmesh_views.h"

namespace {

using namespace pietra;
using namespace pietra::pmesh;

/// Over some frames.
struct Sum {
    uint64_t operations = 0, vertices = 0, faces = 0;
    uint32_t least = ~0u;
    double cpu = 0, wall = 0;
    template <class Frame>
    void add(const SplitFront& front, Frame&& frame) {
        const double c = processSeconds(), w = wallSeconds();
        const uint32_t done = frame();
        cpu += processSeconds() - c;
        wall += wallSeconds() - w;
        operations += done;
        least = std::min(least, done);
        vertices += front.vertexCount();
        faces += front.triangleCount();
    }
    void print(const char* name, int frames) const {
        std::printf(
            "    %s: %8llu vertices %8llu faces %6llu operations (least %u):"
            " %.2f M/s of processor, %.2f M/s, %.2f ms\n",
            name, static_cast<unsigned long long>(vertices / frames),
            static_cast<unsigned long long>(faces / frames),
            static_cast<unsigned long long>(operations / frames), least,
            double(operations) / cpu * 1e-6, double(operations) / wall * 1e-6, wall / frames * 1e3);
    }
};

class Bench {
public:
    Bench(SplitForest forest, const Box3d& box)
        : lattice_(forest.lattice), box_(box), node_(forest.node), nodes_(std::move(forest), ~0u) {
        for (NodeIndex n = 0; n < node_.size(); ++n)
            if (nodes_.forest().row[n].parent != kNoNode && !nodes_.arrive(n, node_[n]))
                std::abort();
        node_.clear();
    }
    void run() {
        for (int i = 0; i < 2; ++i)
            for (const bool all : {true, false}) {
                Sum sum;
                sum.add(front_, [&] { return adapt(wholeSplitView(all)); });
                sum.print(all ? "refine all " : "coarsen all", 1);
            }
        for (const double pixels : {1.0, 0.25, 0.1}) hover(pixels);
        for (const double pixels : {1.0, 0.25, 0.1})
            for (const bool chunks : {false, true}) storm(pixels, chunks);
    }

private:
    uint32_t adapt(const SplitView& view) {
        nodes_.look(view);
        return front_.adapt(view).operations();
    }
    SplitView viewOf(const View& view, double pixels) const {
        return splitView(view, lattice_, nodes_.forest().grid, pixels);
    }
    void storm(double pixels, bool chunks) {
        constexpr int kFrames = 24;
        Sum best;
        for (int round = 0; round < 6; ++round) {
            Sum sum;
            for (int f = 0; f <= kFrames; ++f) {
                if (f == 1) sum = {};
                const SplitView view = viewOf(stormCamera(box_, lattice_, f), pixels);
                sum.add(front_, [&] {
                    const uint32_t operations = adapt(view);
                    if (chunks) chunks_.update();
                    return operations;
                });
            }
            if (round == 0 || sum.cpu < best.cpu) best = sum;
        }
        std::printf("  storm at %.2f px%s\n", pixels, chunks ? ", with chunks" : "");
        best.print("", kFrames);
    }
    void hover(double pixels) {
        std::vector<double> ns;
        const auto view = [&](int frame) {
            return viewOf(cameraFrom(box_, lattice_, 2 + 1e-5 * frame, 0.4), pixels);
        };
        adapt(view(0));
        for (int frame = 1; frame <= 200; ++frame) {
            const SplitView v = view(frame);
            const double begin = processSeconds();
            adapt(v);
            ns.push_back((processSeconds() - begin) * 1e9 / double(front_.vertexCount()));
        }
        std::sort(ns.begin(), ns.end());
        std::printf(
            "  hover at %.2f px: %zu vertices: median %.2f, 90 %% %.2f ns a vertex of "
            "processor time\n",
            pixels, front_.vertexCount(), ns[100], ns[180]);
    }

    const Lattice lattice_;
    const Box3d box_;
    std::vector<SplitNode> node_;
    ResidentSplits nodes_;
    SplitFront front_{nodes_};
    SplitChunks chunks_{nodes_, front_.blocks()};
};

void run(const char* path) {
    Budget budget(size_t(8) << 30);
    TempSpace space{"/tmp", &budget, size_t(1) << 30};
    Progress progress;
    const auto source = openSource({path});
    WholeMesh whole = readWholeMesh(*source, path, {}, space, progress);
    Box3d box;
    for (const Vec3i& p : whole.mesh.position) box.add(whole.lattice.toInput(p));
    const size_t triangles = whole.mesh.triangleCount();
    SplitForest forest = buildInCore(std::move(whole.mesh), whole.lattice, budget);
    uint64_t splits = 0, bytes = 0;
    for (const SplitNode& node : forest.node) {
        splits += node.split.size();
        bytes += encodeSplitNode(node).size();
    }
    std::printf("%s: %zu triangles, %llu operations in %zu nodes, %.1f bytes each, %zu roots\n",
                path, triangles, static_cast<unsigned long long>(splits), forest.node.size(),
                double(bytes) / double(splits), forest.base.root.size());
    Bench(std::move(forest), box).run();
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        std::fprintf(stderr, "usage: bench_pmesh JOBS MESH...\n");
        return 2;
    }
    const ThreadLimit limit(std::atoi(argv[1]));
    for (int i = 2; i < argc; ++i) run(argv[i]);
}
