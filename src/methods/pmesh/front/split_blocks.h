#pragma once
// Where the active vertices lie in memory, and which of them a leaf hangs below.
//
// A block is a run of leaves; its vertices, those that begin in it, lie in pages of its own, in any
// slot. Which vertices there are is a bit a leaf; counting bits tells the vertex that a leaf hangs
// below, and its place in the order of leaves. All that is as of the last commit(), which also cuts
// blocks of many vertices and joins those of few.
//
// Deterministic, but for where in memory pages lie. Memory: bytes(). Thread-safe: what is const,
// and add() to different blocks.

#include <bit>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "methods/pmesh/front/split_page.h"

namespace pietra::pmesh {

/// GCC 12 takes functions that only prefetch for such without effects, and removes calls of them:
/// an effect keeps them.
inline void prefetchLines(const void* from, size_t bytes) {
    for (size_t i = 0; i < bytes; i += 64) __builtin_prefetch(static_cast<const char*>(from) + i);
    asm volatile("");
}

class SplitBlocks {
public:
    static constexpr uint32_t kNone = ~0u;
    struct Block {
        uint32_t word_begin = 0, word_end = 0;  ///< of 64 leaves
        uint32_t previous = kNone, next = kNone;
        uint32_t alive = 0;
        uint32_t first_free = 0;      ///< all pages before are full
        std::vector<uint32_t> page;   ///< places in the pool
        std::vector<uint16_t> order;  ///< slots by leaf
        uint64_t version = 0;         ///< grows when anything in it has changed
        bool changed = false;         ///< since the last commit
        // Of whoever adapts; forgotten where pages of the block change.
        std::vector<uint16_t> dropping, opening, grown;  ///< pages
    };
    /// A vertex, until the next commit: of a block, in the order of leaves.
    struct Place {
        uint32_t block, rank;
        bool operator==(const Place&) const = default;
    };
    struct Slot {
        SplitPage& page;
        uint32_t i;
    };

    SplitBlocks(Leaf leaves, size_t words_a_vertex);

    std::vector<Block>& all() { return block_; }
    const std::vector<Block>& all() const { return block_; }
    SplitPage& page(const Block& b, uint32_t page) const {
        const uint32_t place = b.page[page];
        return pool_[place / kSlabPages][place % kSlabPages];
    }
    template <class Column>
    void prefetch(uint32_t block, Column SplitPage::*column) const {
        const Block& b = block_[block];
        for (uint32_t p = 0; p < b.page.size(); ++p)
            prefetchLines(&(page(b, p).*column), sizeof(Column));
    }
    Slot at(const Block& b, uint32_t slot) const {
        return {page(b, slot / kPageVertices), slot % kPageVertices};
    }
    Slot at(Place p) const { return at(block_[p.block], block_[p.block].order[p.rank]); }
    Leaf firstLeaf(Place p) const {
        const auto [page, i] = at(p);
        return page.first[i];
    }
    /// Of the vertex, then of what it is merged to.
    uint32_t* wordsOf(const Block& b, uint32_t slot) const {
        const uint32_t place = b.page[slot / kPageVertices];
        return &words_[place / kSlabPages]
                      [(size_t(place % kSlabPages) * kPageVertices + slot % kPageVertices) * 2 *
                       words_a_vertex_];
    }
    const uint32_t* wordsOf(Place p) const {
        return words_a_vertex_ ? wordsOf(block_[p.block], block_[p.block].order[p.rank]) : nullptr;
    }
    size_t wordsAVertex() const { return words_a_vertex_; }

    uint64_t latestVersion() const { return version_; }
    size_t countOf(uint32_t block) const { return block_[block].order.size(); }
    size_t vertexCount() const { return vertices_; }
    /// Another one for each vertex.
    static uint32_t keyOf(Place p) { return p.block << kRankBits | p.rank; }
    /// The block that a leaf lies in; the vertex that it hangs below begins in that or before.
    uint32_t blockOf(Leaf leaf) const { return index_[leaf / 64] >> kRankBits; }
    Place ownerOf(Leaf leaf) const {
        const uint32_t word = leaf / 64;
        const uint64_t below = bits_[word] << (63 - leaf % 64);
        const uint32_t rank = (index_[word] & kRankMask) + uint32_t(std::popcount(below));
        const uint32_t block = index_[word] >> kRankBits;
        if (rank > 0) [[likely]]
            return {block, rank - 1};
        const uint32_t before = block_[block].previous;
        return {before, uint32_t(block_[before].order.size()) - 1};
    }

    /// The keys of those.
    void ownersOf(std::span<const Leaf> leaf, std::span<uint32_t> key) const;
    static Place placeOf(uint32_t key) { return {key >> kRankBits, key & kRankMask}; }

    /// A slot in the block, whose leaves `first` is one of. All but that is to be filled in.
    uint32_t add(Block& b, Leaf first);
    /// Bits of SplitPage::alive may have been cleared; Block::alive and first_free say so.
    void commit();

    size_t bytes() const;
    /// Pages that are not used go back to the system.
    void giveBack() { giveBack(free_pages_.size()); }
    /// So much a vertex more takes, at most, but for a few KiB.
    static constexpr size_t kVertexBytes = sizeof(SplitPage) / kPageVertices * 3 / 2 + 16;

private:
    static constexpr uint32_t kRankBits = 12, kRankMask = (1u << kRankBits) - 1;
    static constexpr uint32_t kMostVertices = 960, kFewVertices = 320;
    static_assert(kMostVertices < kRankMask);
    static constexpr uint32_t kSlabPages = 256;
    /// From `first` to `last` all are joined.
    struct Join {
        uint32_t first, last;
    };
    /// Into itself and these of parts_.
    struct Cut {
        uint32_t block;
        size_t parts_begin, parts_end;
    };

    void giveBack(size_t count);
    uint32_t takePage();
    void dropPage(Block& b);
    void copyVertex(const Block& from, uint32_t slot, Block& to, uint32_t into);
    void pack(Block& b);
    void setBits(Block& b);
    std::vector<Join> joins() const;
    void join(const Join& join);
    std::vector<Cut> cuts(std::vector<uint32_t>& parts);
    void cut(const Cut& cut, const std::vector<uint32_t>& parts);
    void number(uint32_t block);
    uint32_t newBlock();

    const size_t words_a_vertex_;
    std::vector<uint64_t> bits_;   ///< a bit a leaf: an active vertex begins there
    std::vector<uint32_t> index_;  ///< of each 64: their block, and how many begin in it before
    std::vector<Block> block_;     ///< the first one has the first leaves
    std::vector<uint32_t> free_blocks_;
    struct Free {
        void operator()(SplitPage* p) const { std::free(p); }
    };
    std::vector<std::unique_ptr<SplitPage[], Free>> pool_;
    mutable std::vector<std::vector<uint32_t>> words_;  ///< by slab
    std::mutex pool_mutex_;
    std::vector<uint32_t> free_pages_, clean_pages_;  ///< the latter take no memory
    size_t least_free_ = 0;
    size_t vertices_ = 0;
    uint64_t version_ = 0;
};

/// body(index of the bit) for all that are set, in their order.
template <class Body>
void forBits(uint32_t bits, Body&& body) {
    for (; bits != 0; bits &= bits - 1) body(uint32_t(std::countr_zero(bits)));
}

}  // namespace pietra::pmesh
