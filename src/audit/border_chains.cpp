#include "audit/border_chains.h"

#include <algorithm>
#include <mutex>

#include "base/check.h"

namespace pietra {

namespace {

EdgeKey edgeOf(uint64_t a, uint64_t b) {
    return {std::min(a, b), std::max(a, b)};
}

}  // namespace

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

/// Goes along all chains and lists the pairs of consecutive kept vertices.
class BorderChains::Walk {
public:
    Walk(const BorderChains& chains, const std::vector<uint8_t>& kept)
        : chains_(chains), kept_(kept), walked_(chains.neighbour_.size(), 0) {}

    std::vector<EdgeKey> pieces() {
        // Loops have no end to start from, so they come last, from a kept vertex each.
        for (uint32_t v = 0; v < kept_.size(); ++v)
            if (chains_.degree(v) != 2) walkFrom(v);
        for (uint32_t v = 0; v < kept_.size(); ++v)
            if (kept_[v]) walkFrom(v);
        std::sort(pieces_.begin(), pieces_.end());
        return std::move(pieces_);
    }

private:
    void walkFrom(uint32_t start) {
        for (uint32_t e = chains_.begin_[start]; e < chains_.begin_[start + 1]; ++e)
            if (!walked_[e]) walkChain(start, e);
    }

    void walkChain(uint32_t start, uint32_t edge) {
        uint32_t last = kept_[start] ? start : kNone;
        uint32_t at = start;
        do {
            const uint32_t next = chains_.neighbour_[edge];
            walked_[edge] = walked_[edgeFrom(next, at)] = 1;
            if (kept_[next]) {
                if (last != kNone)
                    pieces_.push_back(edgeOf(chains_.vertex_[last], chains_.vertex_[next]));
                last = next;
            }
            if (chains_.degree(next) == 2) edge = otherEdge(next, at);
            at = next;
        } while (at != start && chains_.degree(at) == 2);
    }

    uint32_t edgeFrom(uint32_t v, uint32_t to) const {
        uint32_t e = chains_.begin_[v];
        while (chains_.neighbour_[e] != to) ++e;
        return e;
    }

    uint32_t otherEdge(uint32_t v, uint32_t from) const {
        const uint32_t first = chains_.begin_[v];
        return chains_.neighbour_[first] == from ? first + 1 : first;
    }

    const BorderChains& chains_;
    const std::vector<uint8_t>& kept_;
    std::vector<uint8_t> walked_;  // of each direction of each edge
    std::vector<EdgeKey> pieces_;
};

uint64_t BorderChains::countStray(std::span<const EdgeKey> cut_border) const {
    std::vector<uint8_t> kept(vertex_.size(), 0);
    for (const EdgeKey& edge : cut_border)
        for (const uint64_t key : edge)
            if (const uint32_t v = find(key); v != kNone) kept[v] = 1;
    const std::vector<EdgeKey> pieces = Walk(*this, kept).pieces();
    uint64_t stray = 0;
    for (const EdgeKey& edge : cut_border)
        stray += !std::binary_search(pieces.begin(), pieces.end(), edge);
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
