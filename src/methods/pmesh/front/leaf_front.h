#pragma once
// The active vertices of a LeafForest, as a view needs them, and their triangles.
//
// Blocks are runs of kBlockLeaves leaves; a vertex lies in the block of its first leaf, in any slot
// of its pages. Slots are kept while the vertex lives, but for blocks that become so empty that
// they are packed. Which vertices are active is a bit a leaf; so the neighbours in the order of
// leaves, and the vertex that a leaf hangs below, are found by looking for the next bit set.
//
// A frame decides about all vertices in vectors, drops the births that are not needed any more,
// splits what is needed, round by round, and looks up the corners of triangles that name a leaf of
// a block where something changed. Each block by itself, in parallel; what crosses the border of
// blocks waits for the end of a round. The outcome is a function of the view, and where it lies in
// memory of the views before: not of the number of threads.
//
// Memory: 4 KiB for 32 vertices, and 18 bits a leaf; pages are kept for the next frames. Time: docs/design/pmesh.md.

#include <cstdlib>
#include <memory>
#include <mutex>
#include <span>
#include <vector>

#include "base/parallel.h"
#include "methods/pmesh/front/front_kernels.h"

namespace pietra::pmesh {

struct FrontCounts {
    uint32_t splits = 0, merges = 0, rounds = 0;
    uint32_t operations() const { return splits + merges; }
};

class LeafFront {
public:
    /// The roots. `forest` must outlive this.
    explicit LeafFront(const LeafForest& forest);

    /// To exactly the operations that the view needs.
    FrontCounts adapt(const FrontView& view);

    size_t vertexCount() const;
    size_t triangleCount() const;
    /// visit(const FrontPage&, index of its first slot), in the order of blocks.
    template <class Visit>
    void forEachPage(Visit&& visit) const {
        for (uint32_t b = 0; b < block_.size(); ++b)
            for (uint32_t p = 0; p < block_[b].pages; ++p)
                visit(pageOf(b, p), b * kBlockLeaves + p * kPageSlots);
    }
    /// Of the triangles that are always there, as slots.
    const std::vector<uint32_t>& baseCorners() const { return base_slot_; }
    /// The vertex in a slot.
    Leaf firstLeaf(uint32_t slot) const {
        return pageOf(slot >> kBlockBits, slot % kBlockLeaves / kPageSlots)
            .first[slot % kPageSlots];
    }

private:
    static constexpr uint32_t kPages = kBlockLeaves / kPageSlots;
    static_assert(kPages == 64);
    struct Block {
        uint32_t pages = 0;
        uint32_t first_free = 0;  ///< all pages before are full
        uint64_t opened = 0;      ///< a bit a page: has vertices to be split
        uint64_t grown = 0;       ///< a bit a page: its vertices changed, and may have to split
        uint32_t splits = 0, merges = 0;
        bool changed = false;
    };
    /// What another block is to do.
    struct Merge {
        Leaf vertex, split;
        NestedCriterion criterion;
        Vertex merged;
    };
    struct Deferred {
        std::vector<Merge> merge;
        std::vector<Leaf> split;  ///< vertices
    };
    struct Place {
        FrontPage& page;
        uint32_t slot;  ///< in it
    };

    FrontPage& pageOf(uint32_t block, uint32_t page) const {
        return pool_[place_of_page_[block * kPages + page]];
    }
    Place placeOf(Leaf vertex) const {
        const uint32_t slot = slot_[vertex];
        return {pageOf(vertex >> kBlockBits, slot / kPageSlots), slot % kPageSlots};
    }
    bool isActive(Leaf leaf) const {
        return (loadRelaxed(active_[leaf / 64]) >> leaf % 64 & 1) != 0;
    }
    void setActive(Leaf leaf, bool active) {
        uint64_t& word = active_[leaf / 64];
        storeRelaxed(word, word ^ uint64_t(1) << leaf % 64);
        uint32_t& count = count_[leaf >> kBlockBits];
        storeRelaxed(count, active ? count + 1 : count - 1);
    }
    void addPage(uint32_t block);
    void removePage(uint32_t block);
    Place add(Leaf vertex);
    void refer(FrontPage& page, uint32_t slot) const;
    void decide(uint32_t block, const FrontView& view);
    void merge(uint32_t block, Deferred& deferred);
    void applyMerge(const Merge& m);
    void splitAll(uint32_t block, Deferred& deferred);
    void applySplit(Place at);
    void look(uint32_t block, const FrontView& view);
    void prefetch(uint32_t block) const;
    void round(std::span<const uint32_t> blocks, const FrontView& view, Deferred& deferred);
    void pack(uint32_t block);
    void spreadChanges();
    void findCorners(uint32_t block);

    const LeafForest& forest_;
    FrontIndex index_;
    std::vector<uint64_t> bits_;
    uint64_t* active_;
    std::vector<uint16_t, HugeAllocator<uint16_t>> slot_;
    std::vector<uint32_t> count_;
    std::vector<Block> block_;
    /// Pages lie anywhere; only the first of the pool are ever touched.
    struct Free {
        void operator()(FrontPage* p) const { std::free(p); }
    };
    std::unique_ptr<FrontPage[], Free> pool_;
    std::vector<uint32_t> place_of_page_;  ///< kPages a block
    std::mutex pool_mutex_;
    std::vector<uint32_t> free_places_;
    uint32_t pool_end_ = 0;
    std::array<uint64_t, 8> changed_blocks_{};
    std::vector<Leaf> base_leaf_;
    std::vector<uint32_t> base_slot_;
};

}  // namespace pietra::pmesh
