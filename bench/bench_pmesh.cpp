// Progressive meshes: what one costs to build, to store and to adapt.
//
//   bench_pmesh MESH... [--jobs N]

#include <cstdio>
#include <chrono>

#include "base/parallel.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/whole_mesh.h"

using namespace pietra;

static double now() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

int main(int argc, char** argv) {
    for (int i = 1; i < argc; ++i) {
        Budget budget(size_t(8) << 30);
        TempSpace space{"/tmp", &budget, size_t(1) << 30};
        Progress progress;
        const auto source = openSource({argv[i]});
        double t = now();
        pmesh::WholeMesh whole = pmesh::readWholeMesh(*source, argv[i], {}, space, progress);
        std::printf("%s: %zu triangles, shift %d, read %.2f s\n", argv[i], whole.mesh.triangleCount(), whole.lattice.shift, now() - t);
        t = now();
        pmesh::BuildCounts counts;
        const pmesh::ProgressiveMesh mesh = pmesh::buildInCore(std::move(whole.mesh), whole.lattice, budget, &counts);
        std::printf("  built %.2f s: base %zu v %zu f, %zu operations, %u levels, irregular %llu; refused irregular %llu valence %llu imprecise %llu level %llu; inexact %llu, largest %u; RSS peak %zu MB\n",
            now() - t, mesh.base_vertex.size(), mesh.base_triangle.size(), mesh.operation.size(), counts.levels,
            (unsigned long long)counts.irregular_vertices, (unsigned long long)counts.refused.irregular, (unsigned long long)counts.refused.valence, (unsigned long long)counts.refused.imprecise, (unsigned long long)counts.refused.level, (unsigned long long)counts.inexact_ends, counts.largest_error, peakResidentBytes() >> 20);
        std::printf("  validate: '%s'\n", pmesh::validate(mesh).c_str());
    }
}
