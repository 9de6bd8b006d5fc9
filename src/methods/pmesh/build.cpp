#include "methods/pmesh/build.h"

#include <algorithm>

#include "construction/construction.h"
#include "methods/pmesh/diamond_collapses.h"
#include "methods/pmesh/encoder.h"
#include "methods/pmesh/node_codec.h"

namespace pietra::pmesh {
namespace {

/// Pages on their way from the order of encoding to that of the file: nodes by number, which grow
/// level by level.
class PageSpill {
public:
    explicit PageSpill(TempSpace& space) : pages_(space), entries_(space) {}

    void add(NodeIndex n, const NodeRow& row, const OperationNode& node, int lattice_shift) {
        const std::vector<std::byte> page = encodeNode(node);
        const Entry entry{tableNode(n, row, node, lattice_shift), pages_.append(page), page.size()};
        entries_.write(n * sizeof entry, std::as_bytes(std::span(&entry, 1)));
        if (of_level_.size() <= row.level) of_level_.resize(row.level + 1u);
        ++of_level_[row.level];
    }

    /// Fine to coarse.
    void write(ModelWriter& writer, Progress& progress) const {
        std::vector<std::byte> page;
        uint64_t end = entries_.bytes() / sizeof(Entry);
        for (size_t level = of_level_.size(); level-- > 0; end -= of_level_[level]) {
            writer.beginLevel(uint32_t(level));
            for (uint64_t n = end - of_level_[level]; n < end; ++n) {
                Entry entry;
                entries_.read(n * sizeof entry, std::as_writable_bytes(std::span(&entry, 1)));
                for (NodeIndex& child : entry.node.child)
                    if (child != kNoNode) child -= NodeIndex(end);
                page.resize(entry.bytes);
                pages_.read(entry.position, page);
                writer.addPage(page, {&entry.node, 1});
                progress.tick();
            }
        }
    }

private:
    struct Entry {
        Node node;
        uint64_t position = 0;
        size_t bytes = 0;
    };
    Spill pages_, entries_;
    std::vector<uint64_t> of_level_;
};

}  // namespace

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress) {
    Construction work(source, settings, {.name = "pmesh", .stages = 2, .mark_irregular = true},
                      progress);
    BuildReport report = work.report();
    report.stored_triangles = work.input.leaves.triangles;
    ModelInfo info = work.info();

    BuildCounts counts;
    NodeForest forest;
    PageSpill pages(work.space);
    {
        Collapses collapses(work.space);
        collapseByDiamonds(work, settings, progress, collapses);
        progress.beginStage("encode", collapses.store.size());
        forest = encode(collapses, info.lattice, work.space, counts,
                        [&](NodeIndex n, const NodeRow& row, const OperationNode& node) {
                            pages.add(n, row, node, info.lattice.shift);
                            progress.tick(node.operation.size());
                        });
    }
    report.levels = counts.levels;
    // The finest mesh is the input but for the lattice and what offsets cannot tell.
    const double rounding = double(counts.largest_error) * double(1 << info.lattice.shift);
    info.quantisation_error = float(double(info.quantisation_error) + 1.7320509 * rounding);
    progress.beginStage("write", counts.operations / kNodeSlots);
    pages.write(work.writer, progress);
    report.nodes = work.writer.nodeCount();
    work.writer.finish(info, {.method_format = kMethodFormat}, encodeBase(forest));
    progress.endStage();
    work.finish(report);
    return report;
}

}  // namespace pietra::pmesh
