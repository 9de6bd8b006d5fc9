#pragma once
// Union-find over the numbers below a count. The root of a set is its least member, so nothing that
// is read depends on the order of the unions. 4 bytes a number, next to constant time a call.

#include <algorithm>
#include <cstdint>
#include <numeric>
#include <vector>

namespace pietra {

class DisjointSets {
public:
    explicit DisjointSets(size_t count = 0) { grow(count); }

    size_t count() const { return parent_.size(); }
    /// The numbers from count() on become sets of one.
    void grow(size_t count) {
        const size_t had = parent_.size();
        parent_.resize(count);
        std::iota(parent_.begin() + ptrdiff_t(had), parent_.end(), uint32_t(had));
    }

    uint32_t root(uint32_t i) {
        while (parent_[i] != i) i = parent_[i] = parent_[parent_[i]];
        return i;
    }
    void unite(uint32_t a, uint32_t b) {
        if (parent_[a] == parent_[b]) return;
        a = root(a);
        b = root(b);
        if (a != b) parent_[std::max(a, b)] = std::min(a, b);
    }

private:
    std::vector<uint32_t> parent_;
};

}  // namespace pietra
