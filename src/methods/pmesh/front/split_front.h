#pragma once
// The active vertices of a forest of splits, as a view needs them (docs/design/pmesh.md, "By
// leaves").
//
// Applied is what the view needs and is not blocked by what is not in memory, and what was applied
// before and is still needed. Each split decides for itself: the set is closed, as criteria nest.
//
// A frame decides about all vertices in vectors, drops what came by splits that are not needed any
// more, and applies what is needed, from split to split, each block of vertices (split_blocks.h) by
// itself, in parallel; what crosses the border of blocks waits for the end of a round.
//
// The outcome is a function of the view, of the nodes in memory and of what was applied before; it
// does not depend on the number of threads. Memory: bytes(). Time: docs/design/pmesh.md. One thread
// calls.

#include <span>
#include <vector>

#include "base/parallel.h"
#include "methods/pmesh/front/resident_splits.h"
#include "methods/pmesh/front/split_blocks.h"

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

    size_t vertexCount() const { return blocks_.vertexCount(); }
    size_t triangleCount() const { return triangles_; }
    /// Of what could be refined, the largest error in pixels, at the near side of its box; infinite
    /// where the eye is in that. What lies outside of the picture does not count.
    double largestError(const View& view) const;

    /// Until the next frame.
    const SplitBlocks& blocks() const { return blocks_; }
    size_t bytes() const { return blocks_.bytes(); }
    void giveBack() { blocks_.giveBack(); }

private:
    using Block = SplitBlocks::Block;
    using Place = SplitBlocks::Place;
    static constexpr uint32_t kMostInRound = 16384;
    struct Merge {
        Place vertex;
        SplitId split;
        Leaf last;
        NestedCriterion criterion;
        SplitVertex merged;
        const uint32_t* words;
    };
    /// Of a thread.
    struct Work {
        std::vector<Merge> merge;                    ///< of vertices of other blocks
        std::vector<std::array<uint32_t, 2>> split;  ///< block, slot: into other blocks
        uint32_t splits = 0, merges = 0;
        int64_t triangles = 0;
    };

    template <class Body>
    void forBlocks(Body&& body) const;
    bool mayOpen(SplitId split, const NestedCriterion& c) const {
        return nodes_.isLoaded(nodeOfSplit(split)) && !(may_block_ && nodes_.isBlocked(c));
    }
    uint32_t mayOpen(const SplitPage& page, uint32_t needed) const;
    void decide(Block& b, const SplitView& view, Work& work);
    bool isAlive(Leaf name) const;
    void merge(uint32_t block, Work& work);
    void applyMerge(const Merge& m);
    size_t countSplits(const SplitView& view, size_t enough) const;
    SplitView withinLimits(const SplitView& view, const SplitLimits& limits,
                           SplitCounts& counts) const;
    void reopen(Block& b, const SplitView& view) const;
    void look(Block& b, const SplitView& view) const;
    void splitAll(size_t begin, size_t end, const SplitView& view, Work& work);
    void splitOpened(Block& b, Work& work);
    void applySplit(Block& b, uint32_t slot, Block& of_u, Work& work);
    void markGrown(Block& b, uint32_t slot) const;
    void splitAcross(PerThread<Work>& work);
    void findBusy(Block& b) const;

    const ResidentSplits& nodes_;
    SplitBlocks blocks_;
    bool may_block_ = false;  ///< in this frame
    size_t triangles_ = 0;
};

}  // namespace pietra::pmesh
