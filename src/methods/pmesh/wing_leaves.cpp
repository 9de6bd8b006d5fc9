#include "methods/pmesh/wing_leaves.h"

#include <algorithm>

#include "base/check.h"
#include "base/hash.h"
#include "extmem/spill_table.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kBatch = 4096;
constexpr const char* kWhat = "the leaves of vertices";

/// The first leaf of a vertex, or one of its numbers.
struct Entry {
    VertexId vertex;
    uint32_t is_number;  ///< so the leaf comes first
    uint32_t value;
    uint64_t hash() const { return mixBits(vertex); }
    auto operator<=>(const Entry&) const = default;
};

}  // namespace

/// From vertices to their numbers.
class WingLeaves::Shared {
public:
    Shared(uint64_t count, TempSpace& space)
        : table_(*space.budget,
                 size_t(std::min<uint64_t>(space.budget->available() / 2,
                                           (4 << 20) + 4 * sizeof(Entry) * 2 * count)),
                 space.directory, kWhat) {}

    void add(const Entry& entry) {
        batch_.push_back(entry);
        if (batch_.size() == kBatch) flush();
    }

    /// give(span of vertices' leaves and numbers), from several threads.
    template <class Give>
    void forEachRun(Give&& give) {
        flush();
        table_.forEachRun(give);
    }

private:
    void flush() {
        table_.append(batch_);
        batch_.clear();
    }
    SpillTable<Entry> table_;
    std::vector<Entry> batch_;
};

WingLeaves::WingLeaves(const Collapses& collapses, TempSpace& space)
    : collapses_(collapses), space_(space), leaves_(space), corners_(space), found_(corners_) {}

WingLeaves::~WingLeaves() = default;

void WingLeaves::addBatch(std::vector<NumberLeaf>& batch) {
    leaves_.append(std::as_bytes(std::span(batch)));
    batch.clear();
}

void WingLeaves::add(VertexId vertex, Leaf first) {
    if (vertex & kShared) {
        if (!shared_) shared_ = std::make_unique<Shared>(collapses_.store.aliasCount(), space_);
        shared_->add({vertex, 0, first});
    } else {
        batch_.push_back({uint32_t(vertex), first});
        if (batch_.size() == kBatch) addBatch(batch_);
    }
}

void WingLeaves::find() {
    if (shared_) {
        collapses_.store.forEachAlias([&](const VertexAlias& a) {
            shared_->add({a.vertex, 1, uint32_t(a.number)});
        });
        shared_->forEachRun([&](std::span<const Entry> run) {
            std::vector<NumberLeaf> batch;
            for (size_t i = 0, leaf = 0; i < run.size(); ++i) {
                if (!run[i].is_number) leaf = i;
                CHECK(run[leaf].vertex == run[i].vertex);
                if (run[i].is_number) batch.push_back({run[i].value, run[leaf].value});
            }
            addBatch(batch);
        });
        shared_.reset();
    }
    addBatch(batch_);
    const std::vector<std::array<Leaf, 2>> none(1 << 13);
    for (uint64_t i = 0; i < collapses_.store.size(); i += none.size())
        corners_.append(std::as_bytes(std::span(none)));

    const uint64_t room = std::max<uint64_t>(space_.budget->available() / 2 / sizeof(Leaf), 1);
    const auto count = uint32_t(std::min<uint64_t>(collapses_.numbers, room));
    const Reservation memory = space_.budget->reserve(count * sizeof(Leaf), kWhat);
    std::vector<Leaf> leaves(count);
    for (uint64_t begin = 0; begin < collapses_.numbers; begin += count) {
        load(uint32_t(begin), leaves);
        bring(uint32_t(begin), leaves);
    }
    leaves_.clear();
}

/// leaves[i]: the first of the number begin + i.
void WingLeaves::load(uint32_t begin, std::span<Leaf> leaves) const {
    std::vector<NumberLeaf> window;
    for (uint64_t at = 0; at < leaves_.bytes(); at += window.size() * sizeof(NumberLeaf)) {
        window.resize(
            size_t(std::min<uint64_t>(kBatch, (leaves_.bytes() - at) / sizeof(NumberLeaf))));
        leaves_.read(at, std::as_writable_bytes(std::span(window)));
        for (const NumberLeaf& n : window)
            if (n.number - begin < leaves.size()) leaves[n.number - begin] = n.first;
    }
}

void WingLeaves::bring(uint32_t begin, std::span<const Leaf> leaves) {
    std::vector<std::array<Leaf, 2>> window(1 << 13);  // of corners_
    uint64_t at = ~uint64_t(0);
    const auto put = [&] {
        if (at != ~uint64_t(0))
            corners_.write(at * sizeof(window[0]), std::as_bytes(std::span(window)));
    };
    collapses_.store.forEachWings([&](uint32_t record, const Wings& wings) {
        if (record / window.size() * window.size() != at) {
            put();
            at = record / window.size() * window.size();
            corners_.read(at * sizeof(window[0]), std::as_writable_bytes(std::span(window)));
        }
        for (const size_t side : {0u, 1u}) {
            const uint32_t i = wings[side].vertex - begin;
            if (wings[side].vertex != kNoVertex && i < leaves.size())
                window[record - at][side] = leaves[i] + wings[side].offset[2];
        }
    });
    put();
}

}  // namespace pietra::pmesh
