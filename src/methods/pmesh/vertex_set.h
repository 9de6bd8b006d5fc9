#pragma once
// A set of vertices that many threads fill and one empties: in the order of the vertices, whoever
// filled it. A bit a vertex, and one for each 64 of them that tells where to look.

#include <atomic>
#include <bit>
#include <cstdint>
#include <utility>
#include <vector>

namespace pietra::pmesh {

class VertexSet {
public:
    /// Keeps what is in it.
    void resize(size_t vertices) {
        word_.resize((vertices + 63) / 64);
        used_.resize((word_.size() + 63) / 64);
    }
    void clear() {
        std::fill(word_.begin(), word_.end(), 0);
        std::fill(used_.begin(), used_.end(), 0);
    }
    size_t words() const { return word_.size(); }

    bool contains(uint32_t v) const {
        return std::atomic_ref(const_cast<uint64_t&>(word_[v / 64])).load(kOrder) & bitOf(v);
    }
    /// False if it was there.
    bool insert(uint32_t v) {
        const uint64_t before = std::atomic_ref(word_[v / 64]).fetch_or(bitOf(v), kOrder);
        if (before == 0) use(v / 64);
        return !(before & bitOf(v));
    }
    void erase(uint32_t v) { std::atomic_ref(word_[v / 64]).fetch_and(~bitOf(v), kOrder); }
    /// Vertices 64 w and on, of which no other thread sets any meanwhile.
    void insertWord(size_t w, uint64_t bits) {
        if (bits == 0) return;
        word_[w] |= bits;
        use(w);
    }
    /// Not while others insert.
    bool empty() {
        for (size_t i = 0; i < used_.size(); ++i)
            for (uint64_t used = used_[i]; used != 0; used &= used - 1) {
                const int bit = std::countr_zero(used);
                if (word_[64 * i + size_t(bit)] != 0) return false;
                used_[i] &= ~(uint64_t(1) << bit);
            }
        return true;
    }
    /// Moves all to `list`, sorted.
    void take(std::vector<uint32_t>& list) {
        list.clear();
        for (size_t i = 0; i < used_.size(); ++i)
            for (uint64_t used = std::exchange(used_[i], 0); used != 0; used &= used - 1) {
                const size_t w = 64 * i + size_t(std::countr_zero(used));
                for (uint64_t bits = std::exchange(word_[w], 0); bits != 0; bits &= bits - 1)
                    list.push_back(uint32_t(64 * w + size_t(std::countr_zero(bits))));
            }
    }

private:
    static constexpr auto kOrder = std::memory_order_relaxed;
    static uint64_t bitOf(uint32_t v) { return uint64_t(1) << (v % 64); }
    void use(size_t w) { std::atomic_ref(used_[w / 64]).fetch_or(uint64_t(1) << (w % 64), kOrder); }

    std::vector<uint64_t> word_, used_;
};

}  // namespace pietra::pmesh
