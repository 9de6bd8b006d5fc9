#include "audit/border_chains.h"

#include <algorithm>
#include <mutex>

#include "base/check.h"
#include "base/disjoint_sets.h"

namespace pietra {

BorderChains::BorderChains(std::span<const EdgeKey> border, Budget& budget)
    : reservation_(budget.reserve(border.size() * 40, "the border chains of the input")) {
    CHECK_LT(border.size(), size_t(kNone) / 2);
    vertex_.reserve(2 * border.size());
    for (const EdgeKey& edge : border) vertex_.insert(vertex_.end(), edge.begin(), edge.end());
    std::sort(vertex_.begin(), vertex_.end());
    vertex_.erase(std::unique(vertex_.begin(), vertex_.end()), vertex_.end());
    begin_.assign(vertex_.size() + 1, 0);
    for (const EdgeKey& edge : border)
        for (const uint64_t key : edge) ++begin_[find(key) + 1];
    for (size_t v = 0; v < vertex_.size(); ++v) begin_[v + 1] += begin_[v];
    neighbour_.resize(2 * border.size());
    std::vector<uint32_t> cursor(begin_.begin(), begin_.end() - 1);
    for (const EdgeKey& edge : border) {
        const uint32_t a = find(edge[0]), b = find(edge[1]);
        neighbour_[cursor[a]++] = b;
        neighbour_[cursor[b]++] = a;
    }
}

uint32_t BorderChains::find(uint64_t key) const {
    const auto it = std::lower_bound(vertex_.begin(), vertex_.end(), key);
    return it != vertex_.end() && *it == key ? uint32_t(it - vertex_.begin()) : kNone;
}

uint64_t BorderChains::countStray(std::span<const EdgeKey> cut_border) const {
    std::vector<uint8_t> kept(vertex_.size(), 0);
    for (const EdgeKey& edge : cut_border)
        for (const uint64_t key : edge)
            if (const uint32_t v = find(key); v != kNone) kept[v] = 1;
    DisjointSets dropped(vertex_.size());
    for (uint32_t v = 0; v < vertex_.size(); ++v)
        for (const uint32_t w : neighboursOf(v))
            if (!kept[v] && !kept[w]) dropped.unite(v, w);
    const auto hasWay = [&](uint32_t p, uint32_t q) {
        if (p == kNone || q == kNone) return false;
        std::vector<uint32_t> sets;
        for (const uint32_t v : neighboursOf(p)) {
            if (v == q) return true;
            if (!kept[v]) sets.push_back(dropped.root(v));
        }
        std::sort(sets.begin(), sets.end());
        const std::span<const uint32_t> ends = neighboursOf(q);
        return std::any_of(ends.begin(), ends.end(), [&](uint32_t v) {
            return !kept[v] && std::binary_search(sets.begin(), sets.end(), dropped.root(v));
        });
    };
    uint64_t stray = 0;
    for (const EdgeKey& edge : cut_border) stray += !hasWay(find(edge[0]), find(edge[1]));
    return stray;
}

CrackReport countCracksWithin(const BorderChains& chains, const PatchStream& stream,
                              std::span<const NodeIndex> nodes, Budget& budget, size_t memory_bytes,
                              const std::string& temp_dir) {
    std::mutex mutex;
    std::vector<EdgeKey> border;
    Reservation reservation;
    CrackReport report =
        countCracks(stream, nodes, budget, memory_bytes, temp_dir, [&](const EdgeKey& edge) {
            const std::lock_guard lock(mutex);
            if (border.size() == border.capacity()) {
                const size_t capacity = std::max<size_t>(1024, 2 * border.capacity());
                Reservation larger =
                    budget.reserve(capacity * 2 * sizeof(EdgeKey), "the border edges of a cut");
                border.reserve(capacity);
                reservation = std::move(larger);
            }
            border.push_back(edge);
        });
    const uint64_t stray = chains.countStray(border);
    report.cracked_edges += stray;
    report.border_edges -= stray;
    return report;
}

}  // namespace pietra
