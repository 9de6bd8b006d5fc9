#include "methods/pmesh/build.h"

#include <algorithm>

#include "construction/construction.h"
#include "methods/pmesh/diamond_collapses.h"
#include "methods/pmesh/encoder.h"
#include "methods/pmesh/node_codec.h"

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

}  // namespace

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    Construction work(source, settings, {.name = "pmesh", .stages = 2, .mark_irregular = true},
                      progress);
    BuildReport report = work.report();
    report.stored_triangles = work.input.leaves.triangles;
    if (source.schema().colours || !source.schema().scalars.empty())
        report.notes.push_back("this method does not carry colours and scalars yet");
    ModelInfo info = work.info();
    info.schema = {};
    info.schema.normals_given = source.schema().normals_given;

    BuildCounts counts;
    NodeForest forest;
    PageSpill pages(work.space);
    {
        Collapses collapses(work.space);
        collapseByDiamonds(work.input, settings.patch_triangles, settings.jobs, work.space,
                           progress, collapses);
        progress.beginStage("encode", collapses.store.size());
        forest = encode(collapses, info.lattice, work.space, counts,
                        [&](NodeIndex n, const NodeRow& row, const OperationNode& node) {
                            pages.add(n, row, node, info.lattice.shift);
                            progress.tick(node.operation.size());
                        });
    }
    report.levels = counts.levels;
    report.nodes = forest.row.size();
    // The finest mesh is the input but for the lattice and what offsets cannot tell.
    const double rounding = double(counts.largest_error) * double(1 << info.lattice.shift);
    info.quantisation_error = float(double(info.quantisation_error) + 1.7320509 * rounding);
    progress.beginStage("write", forest.row.size());
    pages.write(work.writer, progress);
    work.writer.finish(info, {}, encodeBase(forest));
    progress.endStage();
    work.finish(report);
    return report;
}

}  // namespace pietra::pmesh
