#pragma once
// Parallel adaption (Derzapf et al. 2011, section 4.2): passes over the active mesh, each of which
// applies all operations that may be applied at once.
//
// A pass, from the state before it:
//   1. Mark every vertex whose next operation the criterion needs.
//   2. A marked vertex with a neighbour of a lower level must wait: mark that neighbour. So on, in
//      rounds over those newly marked, until there are none. A marked one without may split.
//   3. An operation that is not needed may be undone if it is the last of both its vertices, and no
//      other neighbour's last one has its level or a higher one. Where both meet, splits win: no
//      vertex around may be marked.
//   4. Prefix sums give new vertices and faces their places; all splits and merges are done.
//   5. The last elements move into the places that merges left; after as many operations as there
//      are vertices, all are sorted in space.
//
// The set of operations applied when nothing is left to do is the least one that holds all that is
// needed and is closed under dependency: it depends on the criterion alone, not on what was before.
//
// The arrays after each pass are the same for any number of threads. A pass with nothing to do
// reads 22 bytes a vertex. Not thread-safe.

#include <cstdint>
#include <span>
#include <vector>

#include "methods/pmesh/active_mesh.h"
#include "methods/pmesh/criterion.h"

namespace pietra::pmesh {

struct PassCounts {
    uint32_t splits = 0, merges = 0;  ///< dummies included
    uint32_t operations() const { return splits + merges; }
};

class Adaption {
public:
    /// `mesh` must outlive this; validate() must find no fault in it.
    explicit Adaption(const ProgressiveMesh& mesh) : mesh_(mesh) {}

    PassCounts pass(const Criterion& criterion);
    /// Passes until nothing is left to do. Returns their number.
    int settle(const Criterion& criterion);

    const ActiveMesh& mesh() const { return mesh_; }

private:
    struct Split {
        uint32_t v, u, face;
    };
    struct Merge {
        uint32_t v, u;
    };
    /// What a block of consecutive vertices has to do.
    struct Block {
        std::array<bool, 2> fresh{};  ///< some vertex is marked and not looked at yet
        bool may_split = false, may_undo = false;
        std::vector<uint32_t> open;  ///< vertices whose stars must be looked at
        std::vector<Merge> merge;
    };

    /// Why a vertex could not do what it wants: a neighbour. As long as neither has changed since,
    /// it still cannot, and its star need not be walked again.
    struct Blocker {
        uint32_t by = 0;
        uint32_t time = 0;  ///< when this was found; 0: never
        uint8_t want = 0;   ///< the bit of its state
    };
    bool isBlocked(uint32_t v, uint8_t want) const {
        const Blocker& b = blocker_[v];
        return b.want == want && mesh_.pulse[v].changed < b.time && b.by < mesh_.vertexCount() &&
               mesh_.pulse[b.by].changed < b.time;
    }
    uint8_t stateOf(uint32_t v) const {
        return uint8_t(std::atomic_ref(const_cast<uint64_t&>(states_[v / 8]))
                           .load(std::memory_order_relaxed) >>
                       (8 * (v % 8)));
    }
    void setState(uint32_t v, uint64_t bits) {
        std::atomic_ref(states_[v / 8]).fetch_or(bits << (8 * (v % 8)), std::memory_order_relaxed);
    }
    void clearState(uint32_t v, uint64_t bits) {
        std::atomic_ref(states_[v / 8])
            .fetch_and(~(bits << (8 * (v % 8))), std::memory_order_relaxed);
    }
    const Operation& operationBefore(uint32_t u) const {
        return mesh_.source().operation[mesh_.record[u].last];
    }
    template <class Body>
    void forBlocks(Body&& body);
    template <class Body>
    void forStars(std::span<const uint32_t> vertices, Body&& body) const;
    void mark(const Criterion& criterion);
    bool isFresh(uint32_t round) const;
    void force(uint32_t round);
    bool forceAround(uint32_t v, const Star& star, uint32_t next_round);
    void markForced(uint32_t w, uint32_t round);
    void findMerges(const Criterion& criterion);
    bool allowsMerge(uint32_t end, const Star& star, uint32_t u, uint32_t& v);
    void listWork();
    void prefetch(uint32_t v, OperationId id) const;
    void applySplits(std::span<const Split> splits);
    void applyMerges(std::span<const Merge> merges, size_t first);
    void applyWork();

    ActiveMesh mesh_;
    size_t since_sort_ = 0;         ///< operations
    std::vector<uint64_t> states_;  ///< eight vertices a word
    std::vector<Block> block_;
    std::vector<Blocker> blocker_;
    std::vector<Split> split_;
    std::vector<Merge> merge_;
    std::vector<uint32_t> free_vertex_, free_face_;
};

}  // namespace pietra::pmesh
