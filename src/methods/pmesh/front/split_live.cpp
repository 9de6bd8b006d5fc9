#include "methods/pmesh/front/split_live.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/budget.h"
#include "base/error.h"
#include "base/stopwatch.h"
#include "methods/pmesh/front/split_chunks.h"
#include "methods/pmesh/front/split_front.h"
#include "methods/pmesh/split_codec.h"
#include "methods/pmesh/split_model.h"

namespace pietra::pmesh {
namespace {

/// Of a vertex: its part of chunks, about.
constexpr size_t kChunkBytes = 72;
/// Of a frame that has little time.
constexpr size_t kFewSplits = 2048;

struct NodePage : LivePage {
    SplitNode node;
};

class LiveSplits : public LiveModel {
public:
    LiveSplits(SplitForest forest, const ModelInfo& info)
        : info_(info),
          rows_(forest.row),
          base_bytes_(bytesOf(forest)),
          nodes_(std::move(forest), uint32_t(rows_.size())),
          front_(nodes_),
          chunks_(nodes_, front_.blocks()) {}

    std::unique_ptr<LivePage> decode(uint32_t page, std::span<const std::byte> bytes,
                                     std::string& fault) const override {
        auto decoded = std::make_unique<NodePage>();
        if (!decodeSplitNode(bytes, rows_[page], nodes_.forest().layout, decoded->node, fault))
            return nullptr;
        return decoded;
    }
    bool arrive(uint32_t page, const LivePage* decoded) override;
    const LiveFrame& adapt(const LiveTask& task) override;
    std::span<const LiveChunk> chunks() const override { return chunks_.chunks(); }
    std::vector<uint32_t> requests(size_t most) const override { return nodes_.requests(most); }
    std::vector<uint32_t> prefetch(const View& view, double pixels, size_t most) override {
        return nodes_.prefetch(viewOf(view, pixels), most);
    }
    size_t bytes() const override { return nodes_.bytes() + meshBytes(); }
    size_t pageBytes() const override { return nodes_.nodeBytes(); }
    size_t release(size_t bytes) override;
    std::span<const std::string> faults() const override { return faults_; }

private:
    static size_t bytesOf(const SplitForest& forest) {
        return forest.base.root.size() * sizeof(SplitBase::Root) +
               forest.base.triangle.size() * (sizeof(Triangle) + 5) +
               forest.base.word.size() * sizeof(uint32_t) + forest.row.size() * 80;
    }
    SplitView viewOf(const View& view, double pixels) const {
        if (pixels <= 0) return wholeSplitView(true);
        return splitView(view, nodes_.forest().lattice, nodes_.forest().grid, pixels, info_.bounds);
    }
    size_t meshBytes() const { return base_bytes_ + front_.bytes() + chunks_.bytes(); }
    size_t bytesOfVertex() const {
        // In pages, of the vertex and of what it is merged to; in chunks, of which some have it.
        const size_t words = 18 * nodes_.forest().layout.words();
        return SplitBlocks::kVertexBytes + kChunkBytes + words;
    }
    size_t roomFor(size_t bytes);
    size_t drawable(uint64_t triangles) const;
    void describe(const LiveTask& task, const SplitCounts& counts, bool drawn_limits);
    void tell(const std::string& what);

    const ModelInfo info_;
    const std::vector<SplitRow> rows_;
    const size_t base_bytes_;
    ResidentSplits nodes_;
    SplitFront front_;
    SplitChunks chunks_;
    double chunks_ms_ = 0;       // of the last frame
    double splits_a_ms_ = 1000;  // about
    LiveFrame frame_;
    std::vector<std::string> faults_;
};

bool LiveSplits::arrive(uint32_t page, const LivePage* decoded) {
    if (!decoded) return nodes_.giveUp(page), true;
    const auto arrived = nodes_.arrive(page, static_cast<const NodePage*>(decoded)->node);
    if (arrived) front_.arrived(*arrived);
    if (!arrived && nodes_.isGivenUp(page))
        tell(fmt::format("page {} does not fit its parent", page));
    return arrived.has_value();
}

/// How many vertices memory has room for.
size_t LiveSplits::roomFor(size_t bytes) {
    const size_t each = bytesOfVertex();
    const auto room = [&] {
        const size_t of_vertices = front_.vertexCount() * each;
        const size_t mesh = front_.bytes() + chunks_.bytes();
        const size_t others = nodes_.bytes() + base_bytes_ + mesh - std::min(mesh, of_vertices);
        return (bytes - std::min(bytes, others)) / each;
    };
    if (room() < front_.vertexCount()) front_.giveBack();
    return room();
}

/// A vertex more is two triangles more, at most.
size_t LiveSplits::drawable(uint64_t triangles) const {
    const SplitBase& base = nodes_.forest().base;
    const uint64_t always = base.triangle.size();
    return base.root.size() + (std::max<uint64_t>(triangles, always) - always) / 2;
}

const LiveFrame& LiveSplits::adapt(const LiveTask& task) {
    const SplitForest& forest = nodes_.forest();
    SplitView view = task.column != nullptr ? columnView(*task.column, forest.lattice, forest.grid)
                                            : viewOf(*task.view, task.pixels);
    if (task.seen != nullptr && task.pixels > 0)
        view.occlusion = std::make_shared<Occlusion>(*task.seen, forest.lattice, forest.grid);
    nodes_.look(view);
    if (task.only_look) {
        SplitCounts counts;
        counts.short_of_splits = front_.toDo(view) > 0;
        describe(task, counts, false);
        return frame_;
    }
    SplitLimits limits;
    const size_t in_memory = roomFor(task.most_bytes), in_picture = drawable(task.most_triangles);
    limits.vertices = std::min(in_memory, in_picture);
    // Where much changes, chunks take a part of the time.
    const double ms = std::max(task.milliseconds - chunks_ms_, task.milliseconds / 4);
    limits.splits = size_t(std::min(std::max(ms * splits_a_ms_, double(kFewSplits)), 1e18));
    Stopwatch watch;
    const SplitCounts counts = front_.adapt(view, limits);
    if (counts.splits >= kFewSplits / 2)
        splits_a_ms_ += 0.2 * (double(counts.splits) / std::max(watch.ms(), 0.01) - splits_a_ms_);
    watch = Stopwatch();
    chunks_.update();
    chunks_ms_ = watch.ms();
    const size_t node_room = task.most_bytes - std::min(task.most_bytes, meshBytes());
    nodes_.setMost((node_room + task.arriving_bytes) / nodes_.nodeBytes());
    describe(task, counts, in_picture <= in_memory);
    if (frame_.short_of_memory) {
        nodes_.evictOldest();
        front_.giveBack();
    }
    return frame_;
}

void LiveSplits::describe(const LiveTask& task, const SplitCounts& counts, bool drawn_limits) {
    frame_.operations = counts.operations();
    frame_.busy = counts.short_of_splits;
    frame_.missing = nodes_.missing();
    frame_.needed_bytes = nodes_.required() * nodes_.nodeBytes() + meshBytes();
    frame_.triangles = front_.triangleCount();
    frame_.short_of_triangles = counts.short_of_vertices && drawn_limits;
    frame_.short_of_memory = (counts.short_of_vertices && !drawn_limits) ||
                             (!frame_.busy && frame_.needed_bytes > task.most_bytes);
    const bool is_done =
        !counts.short_of_splits && !counts.short_of_vertices && !nodes_.anyBlocks();
    frame_.largest_px = is_done ? task.pixels : front_.largestError(*task.view);
}

/// Once.
void LiveSplits::tell(const std::string& what) {
    const std::string fault = "the model is damaged: " + what;
    if (std::find(faults_.begin(), faults_.end(), fault) == faults_.end()) faults_.push_back(fault);
}

size_t LiveSplits::release(size_t bytes) {
    const size_t before = this->bytes();
    front_.giveBack();
    while (this->bytes() + bytes > before && nodes_.evictOldest()) {
    }
    trimHeap();
    return before - this->bytes();
}

}  // namespace

std::unique_ptr<LiveModel> liveOf(SplitForest forest, const ModelInfo& info) {
    return std::make_unique<LiveSplits>(std::move(forest), info);
}

std::unique_ptr<LiveModel> openLive(const ModelReader& reader) {
    SplitForest forest = openForest(reader);
    forest.node.resize(forest.row.size());
    for (NodeIndex n = 0; n < forest.row.size() && forest.row[n].parent == kNoNode; ++n)
        if (const std::string fault = readNode(reader, forest, n, forest.node[n]); !fault.empty())
            throw InputError::atByte(reader.path(), reader.page(n).offset, fault);
    return liveOf(std::move(forest), reader.info());
}

}  // namespace pietra::pmesh
