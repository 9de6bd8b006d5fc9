#include "methods/pmesh/ring_starts.h"

#include <algorithm>

#include "base/check.h"
#include "base/hash.h"
#include "extmem/spill_table.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kBatch = 4096;
constexpr const char* kWhat = "the names of vertices";

/// What a vertex is called, or one of its numbers.
struct Shared {
    VertexId vertex;
    uint32_t is_number;  ///< so the name comes first
    uint32_t value;
    uint64_t hash() const { return mixBits(vertex); }
    auto operator<=>(const Shared&) const = default;
};

}  // namespace

/// From names of vertices to names of numbers.
class RingStarts::SharedNames {
public:
    SharedNames(uint64_t count, TempSpace& space)
        : table_(*space.budget,
                 size_t(std::min<uint64_t>(space.budget->available() / 2,
                                           (4 << 20) + 4 * sizeof(Shared) * 2 * count)),
                 space.directory, kWhat) {}

    void add(const Shared& shared) {
        batch_.push_back(shared);
        if (batch_.size() == kBatch) flush();
    }

    /// give(span of vertices' names and numbers), from several threads.
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
    SpillTable<Shared> table_;
    std::vector<Shared> batch_;
};

RingStarts::RingStarts(const Collapses& collapses, TempSpace& space)
    : collapses_(collapses), space_(space), names_(space), least_(space), found_(least_) {}

RingStarts::~RingStarts() = default;

void RingStarts::addBatch(std::vector<NumberName>& batch) {
    names_.append(std::as_bytes(std::span(batch)));
    batch.clear();
}

void RingStarts::addName(VertexId vertex, uint32_t name) {
    if (vertex & kShared) {
        if (!shared_)
            shared_ = std::make_unique<SharedNames>(collapses_.store.aliasCount(), space_);
        shared_->add({vertex, 0, name});
    } else {
        batch_.push_back({uint32_t(vertex), name});
        if (batch_.size() == kBatch) addBatch(batch_);
    }
}

void RingStarts::find() {
    if (shared_) {
        collapses_.store.forEachAlias([&](const VertexAlias& a) {
            shared_->add({a.vertex, 1, uint32_t(a.number)});
        });
        shared_->forEachRun([&](std::span<const Shared> run) {
            std::vector<NumberName> batch;
            for (size_t i = 0, name = 0; i < run.size(); ++i) {
                if (!run[i].is_number) name = i;
                CHECK(run[name].vertex == run[i].vertex);
                if (run[i].is_number) batch.push_back({run[i].value, run[name].value});
            }
            addBatch(batch);
        });
        shared_.reset();
    }
    addBatch(batch_);
    const std::vector<uint64_t> none(1 << 13, ~uint64_t(0));
    for (uint64_t i = 0; i < collapses_.store.size(); i += none.size())
        least_.append(std::as_bytes(std::span(none)));

    const uint64_t room = std::max<uint64_t>(space_.budget->available() / 2 / sizeof(uint32_t), 1);
    const auto count = uint32_t(std::min<uint64_t>(collapses_.numbers, room));
    const Reservation memory = space_.budget->reserve(count * sizeof(uint32_t), kWhat);
    std::vector<uint32_t> names(count);
    for (uint64_t first = 0; first < collapses_.numbers; first += count) {
        loadNames(uint32_t(first), names);
        takeLeast(uint32_t(first), names);
    }
    names_.clear();
}

/// names[i]: of the number first + i.
void RingStarts::loadNames(uint32_t first, std::span<uint32_t> names) const {
    std::vector<NumberName> window;
    for (uint64_t at = 0; at < names_.bytes(); at += window.size() * sizeof(NumberName)) {
        window.resize(
            size_t(std::min<uint64_t>(kBatch, (names_.bytes() - at) / sizeof(NumberName))));
        names_.read(at, std::as_writable_bytes(std::span(window)));
        for (const NumberName& n : window)
            if (n.number - first < names.size()) names[n.number - first] = n.name;
    }
}

void RingStarts::takeLeast(uint32_t first, std::span<const uint32_t> names) {
    std::vector<uint64_t> window(1 << 13);  // of least_
    uint64_t begin = ~uint64_t(0);
    const auto put = [&] {
        if (begin != ~uint64_t(0))
            least_.write(begin * sizeof(uint64_t), std::as_bytes(std::span(window)));
    };
    collapses_.store.forEachClosedRing([&](uint32_t record, std::span<const uint32_t> ring) {
        if (record / window.size() * window.size() != begin) {
            put();
            begin = record / window.size() * window.size();
            least_.read(begin * sizeof(uint64_t), std::as_writable_bytes(std::span(window)));
        }
        uint64_t& least = window[record - begin];
        for (uint64_t place = 0; place < ring.size(); ++place) {
            const uint32_t i = ring[place] - first;
            if (i < names.size()) least = std::min(least, names[i] * kPlaces + place);
        }
    });
    put();
}

}  // namespace pietra::pmesh
