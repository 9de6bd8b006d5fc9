#include "methods/tetra/build.h"

#include <sys/stat.h>

#include "base/parallel.h"
#include "coarsen/input_leaves.h"
#include "methods/tetra/levels.h"
#include "store/model_writer.h"

namespace pietra::tetra {

namespace {

uint64_t fileBytes(const std::string& path) {
    struct stat info {};
    return ::stat(path.c_str(), &info) == 0 ? uint64_t(info.st_size) : 0;
}

}  // namespace

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    const ThreadLimit threads(settings.jobs);
    const MemoryPlan plan(settings.memory_bytes, settings.jobs,
                          VertexRecord(source.schema()).bytes);
    Budget budget(plan.budget);
    TempSpace space{settings.temp_dir, &budget, plan.work};
    progress.setStages(InputLeaves::kStages + 2);
    // Made first: an output that exists or cannot be written is known before any work.
    ModelWriter writer(settings.output, settings.force, settings.temp_dir, budget);

    InputLeaves input(source,
                      {settings.input_name, settings.precision, settings.leaf_triangles, false},
                      plan, space, progress);
    const VertexTable& vertices = input.vertices;
    Leaves& leaves = input.leaves;

    LevelSettings level_settings{
        settings.patch_triangles, vertices.lattice().shift,     source.schema(),
        vertices.scalarRanges(),  vertices.quantisationError(), settings.jobs};
    const LevelCounts counts = buildLevels(leaves, level_settings, space, writer, progress);

    BuildReport report;
    report.input_triangles = input.inputTriangles();
    report.input_vertices = vertices.size();
    report.dropped_degenerate = input.degenerate;
    report.dropped_duplicate = leaves.duplicates;
    report.border_edges = leaves.edges.border;
    report.non_manifold_edges = leaves.edges.non_manifold;
    report.inconsistent_edges = leaves.edges.inconsistent;
    report.levels = counts.levels;
    report.stored_triangles = counts.triangles;
    report.nodes = writer.nodeCount();
    report.notes = source.notes();

    progress.beginStage("write", 0);
    ModelInfo info;
    info.method = "tetra";
    info.lattice = vertices.lattice();
    info.schema = source.schema();
    info.input_triangles = report.input_triangles;
    info.input_vertices = report.input_vertices;
    info.input_files = settings.input_files;
    info.dropped_degenerate = report.dropped_degenerate;
    info.dropped_duplicate = report.dropped_duplicate;
    info.quantisation_error = vertices.quantisationError();
    info.bounds = vertices.bounds();
    writer.finish(info);
    progress.endStage();
    report.output_bytes = fileBytes(settings.output);
    report.temp_bytes_peak = space.peak_bytes;
    return report;
}

}  // namespace pietra::tetra
