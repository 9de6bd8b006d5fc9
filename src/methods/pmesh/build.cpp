#include "methods/pmesh/build.h"

#include <algorithm>

#include "construction/construction.h"
#include "methods/pmesh/diamond_collapses.h"
#include "methods/pmesh/split_codec.h"
#include "methods/pmesh/split_encoder.h"
#include "methods/pmesh/split_faults.h"

namespace pietra::pmesh {
namespace {

/// Pages on their way from the order of encoding to that of the file: nodes by number, which grow
/// level by level.
class PageSpill {
public:
    explicit PageSpill(TempSpace& space) : pages_(space), entries_(space) {}

    void add(NodeIndex n, const Node& node, std::span<const std::byte> page) {
        const Entry entry{node, pages_.append(page), page.size()};
        entries_.write(n * sizeof entry, std::as_bytes(std::span(&entry, 1)));
        if (of_level_.size() <= node.level) of_level_.resize(node.level + 1u);
        ++of_level_[node.level];
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
    SplitForest forest;
    std::vector<Sphere> spheres;
    PageSpill pages(work.space);
    {
        Collapses collapses(work.space);
        collapseByDiamonds(work, settings, progress, collapses);
        progress.beginStage("encode", collapses.store.size());
        forest = encodeSplits(
            collapses, info.lattice, work.space, counts,
            [&](NodeIndex n, const SplitRow& row, const SplitGrid& grid, SplitNode& node) {
                spheres.resize(std::max<size_t>(spheres.size(), n + 1));
                std::vector<Sphere> below;
                for (const NodeIndex c : row.child)
                    if (c != kNoNode) below.push_back(spheres[c]);
                const Node entry = tableNode(n, row, node, info.lattice, grid, below);
                spheres[n] = entry.saturated;
                pages.add(n, entry, encodeSplitNode(node));
                progress.tick(node.split.size());
            });
    }
    report.levels = counts.levels;
    progress.beginStage("write", counts.operations / kSplitSlots);
    pages.write(work.writer, progress);
    report.nodes = work.writer.nodeCount();
    work.writer.finish(info, {.method_format = kMethodFormat}, encodeSplitBase(forest));
    progress.endStage();
    work.finish(report);
    return report;
}

}  // namespace pietra::pmesh
