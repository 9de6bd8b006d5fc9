#include "methods/tetra/build.h"

#include <sys/stat.h>

#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"
#include "coarsen/crumbs.h"
#include "coarsen/diamond.h"
#include "coarsen/leaves.h"
#include "coarsen/partition.h"
#include "coarsen/precision.h"
#include "coarsen/vertex_table.h"
#include "methods/tetra/levels.h"
#include "store/model_writer.h"

namespace pietra::tetra {

namespace {

/// How the memory limit is spent. What the libraries and the program itself take is set aside
/// first; of the rest, `work` is for the stages' own arrays, and temporary data may stay in memory
/// as long as that much remains free.
struct MemoryPlan {
    size_t budget, work;
    PartitionSettings partition;

    MemoryPlan(size_t limit, int jobs, size_t corner_bytes) {
        constexpr size_t kProgram = size_t(48) << 20;
        constexpr size_t kLeast = size_t(64) << 20;
        budget = std::max(limit, kProgram + kLeast) - kProgram;
        work = std::min(budget * 3 / 4, std::max(budget / 3, size_t(jobs) * (size_t(192) << 20)));
        // A triangle in flight has indices twice, and ahead once more, corners, four cells and an
        // order of its corners.
        const size_t triangle_bytes = 3 * 24 + 3 * corner_bytes + 32 + 12;
        partition.batch_triangles =
            std::clamp(work / 2 / triangle_bytes, size_t(1) << 14, size_t(4) << 20);
        partition.buffer_bytes = std::min(work / 4, size_t(128) << 20);
        // A bucket being welded takes about 200 bytes a triangle.
        partition.bucket_triangles =
            std::max(work / size_t(jobs) / (200 + 3 * corner_bytes), size_t(1) << 14);
    }
};

uint64_t fileBytes(const std::string& path) {
    struct stat info {};
    return ::stat(path.c_str(), &info) == 0 ? uint64_t(info.st_size) : 0;
}

}  // namespace

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    const ThreadLimit threads(settings.jobs);
    const VertexRecord record(source.schema());
    const MemoryPlan plan(settings.memory_bytes, settings.jobs, record.bytes);
    Budget budget(plan.budget);
    TempSpace space{settings.temp_dir, &budget, plan.work};
    progress.setStages(7);
    // Made first: an output that exists or cannot be written is known before any work.
    ModelWriter writer(settings.output, settings.force, settings.temp_dir, budget);

    VertexTable vertices(source, settings.input_name, settings.precision, space, progress);
    if (settings.precision.kind == PrecisionSetting::Kind::kAuto)
        vertices.setShift(chooseShift(source, vertices, plan.partition.batch_triangles, progress));
    Partition partition(source, vertices, plan.partition, space, progress);
    vertices.clear();
    if (partition.triangleCount() == 0)
        throw InputError(settings.input_name, "",
                         partition.degenerateCount() > 0
                             ? "there is nothing to show: all triangles are degenerate"
                             : "there is nothing to show: there are no triangles");

    CellStore leaf_store(space, int(source.schema().scalars.size()));
    LeafSettings leaf_settings;
    leaf_settings.leaf_triangles = settings.leaf_triangles;
    leaf_settings.bound = vertices.quantisationError();
    leaf_settings.component_bytes = plan.work / 16;
    Leaves leaves = buildLeaves(partition, record, leaf_settings, space, leaf_store, progress);
    moveCrumbs(leaves, leaf_store, std::min(kSmallestPatch, settings.leaf_triangles / 8), progress);

    LevelSettings level_settings{
        settings.patch_triangles, vertices.lattice().shift,     source.schema(),
        vertices.scalarRanges(),  vertices.quantisationError(), settings.jobs};
    const LevelCounts counts = buildLevels(leaves, level_settings, space, writer, progress);

    BuildReport report;
    report.input_triangles = leaves.triangles + leaves.duplicates + partition.degenerateCount();
    report.input_vertices = vertices.size();
    report.dropped_degenerate = partition.degenerateCount();
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
