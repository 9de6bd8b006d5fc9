#pragma once
// The active vertices of a forest of splits, as a view needs them (docs/design/pmesh.md, "By
// leaves").
//
// Applied is what the view needs and is not blocked by what is not in memory, and what was applied
// before and is still needed. Each split decides for itself: the set is closed, as criteria nest.
//
// Vertices lie in blocks, which part the leaves into runs; so which neighbours in the order of
// leaves are active, and the vertex that a leaf hangs below, are found by counting bits. A frame
// decides about all vertices in vectors, drops what came by splits that are not needed any more,
// and applies what is needed, from split to split, each block by itself, in parallel; what crosses
// the border of blocks waits for the end of a round. Blocks that come to have many vertices are cut
// in two, those with few are joined.
//
// The outcome is a function of the view, of the nodes in memory and of what was applied before; it
// does not depend on the number of threads. Memory: bytes(). Time: docs/design/pmesh.md. One thread
// calls.

#include <bit>
#include <cstdlib>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "methods/pmesh/front/resident_splits.h"
#include "methods/pmesh/front/split_page.h"

namespace pietra::pmesh {

struct SplitLimits {
    size_t vertices = ~size_t(0);  ///< never more, but for those that there are
    size_t splits = ~size_t(0);    ///< in this frame
};

struct SplitCounts {
    uint32_t splits = 0, merges = 0, rounds = 0;
    /// Something needed and not blocked was left out for a limit; what is done is what a view of a
    /// coarser tolerance needs.
    bool short_of_vertices = false, short_of_splits = false;
    uint32_t operations() const { return splits + merges; }
};

class SplitFront {
public:
    /// The roots. `nodes` must outlive this.
    explicit SplitFront(const ResidentSplits& nodes);

    /// `nodes` must have looked at this view.
    SplitCounts adapt(const SplitView& view, const SplitLimits& limits = {});
    /// How many vertices adapt() would begin with to split or to merge: 0 if there is nothing to
    /// do.
    size_t toDo(const SplitView& view) const;
    /// What these vertices wait for has arrived.
    void arrived(std::span<const ResidentSplits::Arrived> arrived);

    size_t vertexCount() const { return vertices_; }
    size_t triangleCount() const { return triangles_; }
    /// Of what could be refined, the largest error in pixels, at the near side of its box; infinite
    /// where the eye is in that. What lies outside of the picture does not count.
    double largestError(const View& view) const;
    /// What pages, blocks and the index of leaves take.
    size_t bytes() const;
    /// Pages that are not used go back to the system.
    void giveBack();
    /// So much a vertex more takes, at most, but for a few KiB.
    static constexpr size_t kVertexBytes = sizeof(SplitPage) / kPageVertices * 3 / 2 + 16;

    // ---- what is drawn

    /// A vertex, until the next frame: of a block, in the order of leaves.
    struct Place {
        uint32_t block, rank;
        bool operator==(const Place&) const = default;
    };
    /// Of a slot.
    struct Slot {
        const SplitPage& page;
        uint32_t i;
        const uint32_t* words;  ///< if the forest has any
    };
    size_t blockCount() const { return block_.size(); }
    /// 0: there is no such block. Grows when anything in it has changed.
    uint64_t version(uint32_t block) const { return block_[block].version; }
    uint64_t latestVersion() const { return version_; }
    /// 0: there is no such block.
    size_t countOf(uint32_t block) const { return block_[block].order.size(); }
    Slot slotAt(Place p) const {
        const Block& b = block_[p.block];
        const uint32_t slot = b.order[p.rank], page = b.page[slot / kPageVertices];
        return {pool_[page / kSlabPages][page % kSlabPages], slot % kPageVertices,
                words_a_vertex_ ? wordsOf(b, slot) : nullptr};
    }
    /// Another one for each vertex.
    static uint32_t keyOf(Place p) { return p.block << kRankBits | p.rank; }
    Leaf firstLeaf(Place p) const { return block_[p.block].leaf[p.rank]; }
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

private:
    static constexpr uint32_t kRankBits = 12, kRankMask = (1u << kRankBits) - 1;
    static constexpr uint32_t kMostInBlock = 960, kFewInBlock = 320, kMostInRound = 16384;
    static_assert(kMostInBlock < kRankMask);
    static constexpr uint32_t kNone = ~0u;
    static constexpr uint32_t kSlabPages = 256;

    struct Block {
        uint32_t word_begin = 0, word_end = 0;  ///< of 64 leaves
        uint32_t previous = kNone, next = kNone;
        uint32_t alive = 0;
        uint32_t first_free = 0;      ///< all pages before are full
        std::vector<uint32_t> page;   ///< places in the pool
        std::vector<uint16_t> order;  ///< slots by leaf, when the frame began
        std::vector<Leaf> leaf;       ///< likewise
        std::vector<uint16_t> added;  ///< slots, since then
        std::vector<uint16_t> queue;  ///< slots to be split
        uint32_t splits = 0, merges = 0;
        int32_t triangles = 0;  ///< gained in this frame
        uint64_t version = 0;
        bool changed = false;
    };
    struct Merge {
        Place vertex;
        SplitId split;
        Leaf last;
        NestedCriterion criterion;
        SplitVertex merged;
        const uint32_t* words;
    };
    struct Deferred {
        std::vector<Merge> merge;
        std::vector<std::array<uint32_t, 2>> split;  ///< block, slot
    };

    SplitPage& pageAt(const Block& b, uint32_t slot) const {
        const uint32_t place = b.page[slot / kPageVertices];
        return pool_[place / kSlabPages][place % kSlabPages];
    }
    uint32_t* wordsOf(const Block& b, uint32_t slot) const {
        const uint32_t place = b.page[slot / kPageVertices];
        return &words_[place / kSlabPages]
                      [(size_t(place % kSlabPages) * kPageVertices + slot % kPageVertices) * 2 *
                       words_a_vertex_];
    }
    uint32_t takePage();
    void addPage(Block& b);
    void dropPages(Block& b);
    uint32_t add(Block& b, Leaf first);
    void copyVertex(const Block& from, uint32_t slot, Block& to, uint32_t into);

    bool mayOpen(SplitId split, const NestedCriterion& c) const {
        return nodes_.isLoaded(nodeOfSplit(split)) && !(blocks_ && nodes_.isBlocked(c));
    }
    uint32_t mayOpen(const SplitPage& page, uint32_t needed) const;
    void decide(Block& b, const SplitView& view);
    void reopen(Block& b, const SplitView& view);
    bool isAlive(Leaf name) const;
    void merge(uint32_t block, Deferred& deferred);
    void applyMerge(const Merge& m);
    size_t countSplits(const SplitView& view, size_t enough);
    SplitView withinLimits(const SplitView& view, const SplitLimits& limits, SplitCounts& counts);
    void fillQueue(Block& b);
    void prefetch(const Block& b, uint32_t slot) const;
    void splitAll(uint32_t block, const SplitView& view, Deferred& deferred);
    void applySplit(Block& b, uint32_t slot, Block& of_u, const SplitView& view);
    void openIfNeeded(Block& b, uint32_t slot, const SplitView& view);
    void commit();
    void sortBlock(Block& b);
    void cutBlock(uint32_t block);
    void joinNext(uint32_t block);
    void rewrite(Block& b, size_t begin, size_t end, Block& to);
    void writeIndex(uint32_t block);
    uint32_t newBlock();

    const ResidentSplits& nodes_;
    const size_t words_a_vertex_;
    std::vector<uint64_t> bits_;   ///< a bit a leaf: an active vertex begins there
    std::vector<uint32_t> index_;  ///< of each 64: their block, and how many begin in it before
    std::vector<Block> block_;
    std::vector<uint32_t> free_blocks_;
    struct Free {
        void operator()(SplitPage* p) const { std::free(p); }
    };
    std::vector<std::unique_ptr<SplitPage[], Free>> pool_;
    /// Of each slot its vertex's, then what it is merged to.
    mutable std::vector<std::vector<uint32_t>> words_;
    std::mutex pool_mutex_;
    std::vector<uint32_t> free_pages_, clean_pages_;  ///< the latter take no memory
    bool blocks_ = false;
    size_t vertices_ = 0, triangles_ = 0;
    uint64_t version_ = 1;
};

}  // namespace pietra::pmesh
