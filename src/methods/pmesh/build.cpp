#include "methods/pmesh/build.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "base/parallel.h"
#include "methods/pmesh/diamond_collapses.h"
#include "methods/pmesh/encoder.h"
#include "methods/pmesh/node_codec.h"
#include "store/model_writer.h"

namespace pietra::pmesh {
namespace {

/// Fine to coarse, as the writer wants them.
void writeLevels(const NodeForest& forest, ModelWriter& writer, Progress& progress) {
    constexpr size_t kAtOnce = 1024;
    std::vector<std::vector<std::byte>> page;
    size_t end = forest.row.size();
    while (end > 0) {
        const uint16_t level = forest.row[end - 1].level;
        size_t begin = end;
        while (begin > 0 && forest.row[begin - 1].level == level) --begin;
        writer.beginLevel(level);
        for (size_t first = begin; first < end; first += kAtOnce) {
            page.resize(std::min(kAtOnce, end - first));
            parallelFor(page.size(),
                        [&](size_t i) { page[i] = encodeNode(forest.node[first + i]); });
            for (size_t i = 0; i < page.size(); ++i) {
                const auto n = NodeIndex(first + i);
                Node node = tableNode(n, forest.row[n], forest.node[n], forest.lattice.shift);
                for (NodeIndex& child : node.child)
                    if (child != kNoNode) child -= NodeIndex(end);
                writer.addPage(page[i], {&node, 1});
            }
            progress.tick(page.size());
        }
        end = begin;
    }
}

ModelInfo infoOf(const InputLeaves& input, const BuildSettings& settings,
                 const BuildCounts& counts) {
    const Lattice& lattice = input.vertices.lattice();
    ModelInfo info;
    info.method = "pmesh";
    info.lattice = lattice;
    info.input_triangles = input.inputTriangles();
    info.input_vertices = input.vertices.size();
    info.input_files = settings.input_files;
    info.dropped_degenerate = input.degenerate;
    info.dropped_duplicate = input.leaves.duplicates;
    info.bounds = input.vertices.bounds();
    // The finest mesh is the input but for the lattice and what offsets cannot tell.
    const double rounding = double(counts.largest_error) * double(1 << lattice.shift);
    info.quantisation_error =
        float(double(input.vertices.quantisationError()) + 1.7320509 * rounding);
    return info;
}

BuildReport reportOf(TriangleSource& source, const InputLeaves& input, const BuildCounts& counts) {
    BuildReport report;
    report.input_triangles = input.inputTriangles();
    report.input_vertices = input.vertices.size();
    report.dropped_degenerate = input.degenerate;
    report.dropped_duplicate = input.leaves.duplicates;
    report.stored_triangles = input.leaves.triangles;
    report.border_edges = input.leaves.edges.border;
    report.non_manifold_edges = input.leaves.edges.non_manifold;
    report.inconsistent_edges = input.leaves.edges.inconsistent;
    report.levels = counts.levels;
    report.nodes = counts.row.size();
    report.notes = source.notes();
    if (source.schema().colours || !source.schema().scalars.empty())
        report.notes.push_back("this method does not carry colours and scalars yet");
    return report;
}

}  // namespace

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    const ThreadLimit threads(settings.jobs);
    const MemoryPlan plan(settings.memory_bytes, settings.jobs,
                          VertexRecord(source.schema()).bytes);
    Budget budget(plan.budget);
    TempSpace space{settings.temp_dir, &budget, plan.work};
    progress.setStages(InputLeaves::kStages + 3);
    // Made first: an output that exists or cannot be written is known before any work.
    ModelWriter writer(settings.output, settings.force, settings.temp_dir, budget);
    InputLeaves input(source,
                      {settings.input_name, settings.precision, settings.leaf_triangles, true},
                      plan, space, progress);
    const Lattice& lattice = input.vertices.lattice();

    BuildCounts counts;
    NodeForest forest;
    {
        const Reservation memory = budget.reserve(kEncodeBytes * input.leaves.triangles,
                                                  "a progressive mesh, encoded in memory,");
        const Collapses collapses =
            collapseByDiamonds(input, settings.patch_triangles, settings.jobs, space, progress);
        progress.beginStage("encode", 0);
        const ProgressiveMesh mesh = encode(collapses, lattice, counts);
        // A file has a node, if only an empty one.
        if (counts.row.empty()) counts.row.emplace_back();
        forest = toNodes(mesh, counts.row);
    }
    BuildReport report = reportOf(source, input, counts);
    progress.beginStage("write", forest.row.size());
    writeLevels(forest, writer, progress);
    writer.finish(infoOf(input, settings, counts), {}, encodeBase(forest));
    progress.endStage();
    report.output_bytes = std::filesystem::file_size(settings.output);
    report.temp_bytes_peak = space.peak_bytes;
    return report;
}

}  // namespace pietra::pmesh
