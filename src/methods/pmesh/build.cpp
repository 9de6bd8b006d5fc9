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

/// Pages on their way from the order of encoding to that of the file.
class PageSpill {
public:
    explicit PageSpill(TempSpace& space) : pages_(space) {}

    void add(NodeIndex n, const NodeRow& row, const OperationNode& node, int lattice_shift) {
        const std::vector<std::byte> page = encodeNode(node);
        if (entry_.size() <= n) entry_.resize(n + 1);
        entry_[n] = {tableNode(n, row, node, lattice_shift), pages_.append(page), page.size()};
    }

    /// Fine to coarse.
    void write(ModelWriter& writer, Progress& progress) const {
        std::vector<std::byte> page;
        for (size_t end = entry_.size(); end > 0;) {
            size_t begin = end;
            const uint16_t level = entry_[end - 1].node.level;
            while (begin > 0 && entry_[begin - 1].node.level == level) --begin;
            writer.beginLevel(level);
            for (size_t n = begin; n < end; ++n) {
                Node node = entry_[n].node;
                for (NodeIndex& child : node.child)
                    if (child != kNoNode) child -= NodeIndex(end);
                page.resize(entry_[n].bytes);
                pages_.read(entry_[n].position, page);
                writer.addPage(page, {&node, 1});
            }
            progress.tick(end - begin);
            end = begin;
        }
    }

private:
    struct Entry {
        Node node;
        uint64_t position = 0;
        size_t bytes = 0;
    };
    Spill pages_;
    std::vector<Entry> entry_;
};

ModelInfo infoOf(const InputLeaves& input, const BuildSettings& settings, const BuildCounts& counts,
                 bool normals_given) {
    const Lattice& lattice = input.vertices.lattice();
    ModelInfo info;
    info.method = "pmesh";
    info.lattice = lattice;
    info.schema.normals_given = normals_given;
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

BuildReport reportOf(TriangleSource& source, const InputLeaves& input, const BuildCounts& counts,
                     uint64_t nodes) {
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
    report.nodes = nodes;
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
    PageSpill pages(space);
    {
        Collapses collapses(space);
        collapseByDiamonds(input, settings.patch_triangles, settings.jobs, space, progress,
                           collapses);
        progress.beginStage("encode", collapses.store.size());
        forest = encode(collapses, lattice, space, counts,
                        [&](NodeIndex n, const NodeRow& row, const OperationNode& node) {
                            pages.add(n, row, node, lattice.shift);
                            progress.tick(node.operation.size());
                        });
    }
    BuildReport report = reportOf(source, input, counts, forest.row.size());
    progress.beginStage("write", forest.row.size());
    pages.write(writer, progress);
    writer.finish(infoOf(input, settings, counts, source.schema().normals_given), {},
                  encodeBase(forest));
    progress.endStage();
    report.output_bytes = std::filesystem::file_size(settings.output);
    report.temp_bytes_peak = space.peak_bytes;
    return report;
}

}  // namespace pietra::pmesh
