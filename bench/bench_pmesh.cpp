// Progressive meshes: what one costs to build, to store and to adapt.
//
//   bench_pmesh JOBS MESH...
//
// Printed for each mesh: the build; refining all of it from its base and coarsening it again; and
// 300 frames of a camera that flies in from afar and turns, one pass a frame.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "base/parallel.h"
#include "clock.h"
#include "methods/pmesh/adaption.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/node_codec.h"
#include "methods/pmesh/whole_mesh.h"
#include "pmesh_views.h"

namespace {

using namespace pietra;
using namespace pietra::pmesh;

void report(const NodeForest& mesh, const BuildCounts& counts, double seconds) {
    std::printf(
        "  built in %.2f s: base %zu vertices, %zu triangles; %zu operations, %llu dummies;"
        " %u levels; %llu irregular vertices\n",
        seconds, mesh.base_vertex.size(), mesh.base_triangle.size(), size_t(counts.operations),
        static_cast<unsigned long long>(counts.dummies), counts.levels,
        static_cast<unsigned long long>(counts.irregular_vertices));
    std::printf("  %zu nodes, %.1f %% full, %u levels of them\n", mesh.row.size(),
                100.0 * double(counts.operations) / double(mesh.row.size() * kNodeSlots),
                mesh.row.empty() ? 0 : mesh.row.back().level + 1u);
    std::printf(
        "  refused by valence %llu, by level %llu; %llu ends inexact, by %u steps at most;"
        " resident %zu MiB\n",
        static_cast<unsigned long long>(counts.refused.valence),
        static_cast<unsigned long long>(counts.refused.level),
        static_cast<unsigned long long>(counts.inexact_ends), counts.largest_error,
        peakResidentBytes() >> 20);
}

void reportPages(const NodeForest& forest, const BuildCounts& counts) {
    std::vector<std::vector<std::byte>> pages;
    size_t bytes = encodeBase(forest).size();
    const double begin = processSeconds();
    for (const OperationNode& node : forest.node)
        bytes += pages.emplace_back(encodeNode(node)).size();
    const double encoded = processSeconds();
    OperationNode node;
    std::string fault;
    for (NodeIndex n = 0; n < pages.size(); ++n)
        if (!decodeNode(pages[n], n, forest.row[n], forest.layout, node, fault))
            std::printf("%s\n", fault.c_str());
    const double rate = 1e-6 * double(counts.operations);
    std::printf("  pages: %.2f bytes an operation; %.2f M operations/s encoded, %.2f decoded\n",
                double(bytes) / double(counts.operations), rate / (encoded - begin),
                rate / (processSeconds() - encoded));
}

/// Passes to the end; operations a second.
void settle(const char* what, Adaption& adaption, const Criterion& criterion) {
    const double begin = processSeconds();
    const PassCounts counts = adaption.settle(criterion);
    const double seconds = processSeconds() - begin;
    std::printf("  %s: %u operations in %u passes, %.1f ms: %.2f M/s; %zu faces\n", what,
                counts.operations(), counts.passes, seconds * 1e3,
                counts.operations() / seconds * 1e-6, adaption.mesh().faceCount());
}

void fly(Adaption& adaption, const Box3d& box, const Lattice& lattice, int jobs) {
    double busy_seconds = 0;
    uint64_t operations = 0;
    std::vector<double> quiet_ns;
    for (int frame = 0; frame < 300; ++frame) {
        const double t = frame / 300.0;
        const Criterion view = viewFrom(box, lattice, 2 * t, 0.4 + 2 * (1 - t) * (1 - t), 1);
        const double begin = processSeconds();
        const PassCounts counts = adaption.pass(view);
        const double seconds = processSeconds() - begin;
        busy_seconds += seconds;
        operations += counts.operations();
        if (counts.operations() * 1000 < adaption.mesh().vertexCount())
            quiet_ns.push_back(seconds * 1e9 * jobs / double(adaption.mesh().vertexCount()));
    }
    std::printf("  flight: %zu faces at its end, %.2f M operations/s\n",
                adaption.mesh().faceCount(), double(operations) / busy_seconds * 1e-6);
    if (quiet_ns.empty()) return;
    std::sort(quiet_ns.begin(), quiet_ns.end());
    std::printf("  %zu passes with under 0.1 %% of changes: median %.2f ns a vertex and core\n",
                quiet_ns.size(), quiet_ns[quiet_ns.size() / 2]);
}

void hover(Adaption& adaption, const Box3d& box, const Lattice& lattice, int jobs) {
    std::vector<double> ns;
    uint64_t operations = 0;
    adaption.settle(viewFrom(box, lattice, 2, 0.4, 1));
    for (int frame = 0; frame < 100; ++frame) {
        const Criterion view = viewFrom(box, lattice, 2 + 1e-5 * frame, 0.4, 1);
        const double begin = processSeconds();
        operations += adaption.pass(view).operations();
        ns.push_back((processSeconds() - begin) * 1e9 * jobs /
                     double(adaption.mesh().vertexCount()));
    }
    std::sort(ns.begin(), ns.end());
    std::printf(
        "  hover: %zu vertices, %.1f operations a frame: median %.2f, 90 %% %.2f ns a vertex"
        " and core\n",
        adaption.mesh().vertexCount(), double(operations) / 100, ns[50], ns[90]);
}

/// A camera that rushes to and fro while it circles, eight frames a round: each frame until nothing
/// is left to do.
void storm(Adaption& adaption, const Box3d& box, const Lattice& lattice, double pixels) {
    const auto view = [&](int frame) { return stormView(box, lattice, frame, pixels); };
    adaption.settle(view(0));
    uint64_t operations = 0, passes = 0, vertices = 0;
    uint32_t least = ~0u;
    const int frames = 24;
    const double begin = processSeconds(), wall = wallSeconds();
    for (int frame = 1; frame <= frames; ++frame) {
        const PassCounts counts = adaption.settle(view(frame));
        operations += counts.operations();
        passes += counts.passes;
        vertices += adaption.mesh().vertexCount();
        least = std::min(least, counts.operations());
    }
    std::printf(
        "  storm at %.2f px: %llu vertices, %llu operations a frame (at least %u), %.1f passes:"
        " %.2f M operations/s of processor, %.2f M/s\n",
        pixels, static_cast<unsigned long long>(vertices / frames),
        static_cast<unsigned long long>(operations / frames), least, double(passes) / frames,
        double(operations) / (processSeconds() - begin) * 1e-6,
        double(operations) / (wallSeconds() - wall) * 1e-6);
}

void run(const char* path, int jobs) {
    Budget budget(size_t(8) << 30);
    TempSpace space{"/tmp", &budget, size_t(1) << 30};
    Progress progress;
    const auto source = openSource({path});
    WholeMesh whole = readWholeMesh(*source, path, {}, space, progress);
    std::printf("%s: %zu triangles, lattice shift %d\n", path, whole.mesh.triangleCount(),
                whole.lattice.shift);
    Box3d box;
    for (const Vec3i& p : whole.mesh.position) box.add(whole.lattice.toInput(p));
    BuildCounts counts;
    const double begin = processSeconds();
    const NodeForest forest = buildInCore(std::move(whole.mesh), whole.lattice, budget, &counts);
    const ProgressiveMesh mesh = fromNodes(forest);
    report(forest, counts, processSeconds() - begin);
    reportPages(forest, counts);
    Adaption adaption(mesh);
    for (int i = 0; i < 2; ++i) {
        settle("refine all", adaption, criterionOf(-1.0, mesh.lattice));
        settle("coarsen all", adaption, criterionOf(1e30, mesh.lattice));
    }
    fly(adaption, box, mesh.lattice, jobs);
    hover(adaption, box, mesh.lattice, jobs);
    for (const double pixels : {0.25, 0.1}) storm(adaption, box, mesh.lattice, pixels);
}

}  // namespace

int main(int argc, char** argv) {
    if (argc < 3) {
        std::fprintf(stderr, "usage: bench_pmesh JOBS MESH...\n");
        return 2;
    }
    const int jobs = std::atoi(argv[1]);
    const ThreadLimit limit(jobs);
    for (int i = 2; i < argc; ++i) run(argv[i], jobs);
}
