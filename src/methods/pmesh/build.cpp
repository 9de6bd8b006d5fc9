#include "methods/pmesh/build.h"

#include <algorithm>
#include <cmath>
#include <filesystem>

#include "base/error.h"
#include "base/parallel.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/node_codec.h"
#include "methods/pmesh/whole_mesh.h"
#include "store/model_writer.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kProgram = size_t(48) << 20;

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

WholeMesh read(TriangleSource& source, const BuildSettings& settings, TempSpace& space,
               Progress& progress) {
    WholeMesh whole =
        readWholeMesh(source, settings.input_name, settings.precision, space, progress);
    if (whole.mesh.triangle.empty())
        throw InputError(settings.input_name, "",
                         whole.dropped_degenerate > 0
                             ? "there is nothing to show: all triangles are degenerate"
                             : "there is nothing to show: there are no triangles");
    return whole;
}

ModelInfo infoOf(const WholeMesh& whole, const BuildSettings& settings, const BuildReport& report,
                 const BuildCounts& counts) {
    ModelInfo info;
    info.method = "pmesh";
    info.lattice = whole.lattice;
    info.input_triangles = report.input_triangles;
    info.input_vertices = report.input_vertices;
    info.input_files = settings.input_files;
    info.dropped_degenerate = report.dropped_degenerate;
    info.dropped_duplicate = report.dropped_duplicate;
    info.bounds = whole.bounds;
    // The finest mesh is the input but for the lattice and what offsets cannot tell.
    const double rounding = double(counts.largest_error) * double(1 << whole.lattice.shift);
    info.quantisation_error = float(double(whole.quantisation_error) + 1.7320509 * rounding);
    return info;
}

}  // namespace

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    const ThreadLimit threads(settings.jobs);
    Budget budget(std::max(settings.memory_bytes, 2 * kProgram) - kProgram);
    TempSpace space{settings.temp_dir, &budget, budget.limit() / 2};
    progress.setStages(5);
    // Made first: an output that exists or cannot be written is known before any work.
    ModelWriter writer(settings.output, settings.force, settings.temp_dir, budget);
    WholeMesh whole = read(source, settings, space, progress);

    BuildReport report;
    report.dropped_degenerate = whole.dropped_degenerate;
    report.dropped_duplicate = whole.dropped_duplicate;
    report.input_triangles =
        whole.mesh.triangleCount() + whole.dropped_degenerate + whole.dropped_duplicate;
    report.stored_triangles = whole.mesh.triangleCount();
    report.input_vertices = whole.input_vertices;
    report.notes = source.notes();
    if (source.schema().colours || !source.schema().scalars.empty())
        report.notes.push_back("this method does not carry colours and scalars yet");

    progress.beginStage("collapse", 0);
    BuildCounts counts;
    NodeForest forest;
    {
        const ProgressiveMesh mesh =
            buildInCore(std::move(whole.mesh), whole.lattice, budget, &counts);
        // A file has a node, if only an empty one.
        if (counts.row.empty()) counts.row.emplace_back();
        forest = toNodes(mesh, std::move(counts.row));
    }
    report.levels = counts.levels;
    report.nodes = forest.row.size();

    progress.beginStage("write", forest.row.size());
    writeLevels(forest, writer, progress);
    writer.finish(infoOf(whole, settings, report, counts), {}, encodeBase(forest));
    progress.endStage();
    report.output_bytes = std::filesystem::file_size(settings.output);
    report.temp_bytes_peak = space.peak_bytes;
    return report;
}

}  // namespace pietra::pmesh
