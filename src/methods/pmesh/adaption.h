#pragma once
// Parallel adaption (Derzapf et al. 2011, section 4.2): passes over the active mesh, each of which
// applies all operations that may be applied at once.
//
// A frame looks at all vertices once, for what the criterion needs and for what it does not need any
// more. A pass, from the state before it:
//   1. A marked vertex with a neighbour of a lower level must wait: mark that neighbour. So on, in
//      rounds over those newly marked, until there are none. A marked one without may split.
//   2. An operation that is not needed may be undone if it is the last of both its vertices, and no
//      other neighbour's last one has its level or a higher one. Where both meet, splits win: no
//      vertex around may be marked.
//   3. All splits and merges are done, new elements in free places, in the order of the vertices.
// What must wait remembers *one* neighbour that hinders it, by name, and is looked at again when that
// one splits or merges, in the next pass; for as long as neither changes it still must wait, as an
// edge between two unchanged vertices does not go away. So passes go on from what the last one
// changed, and what hinders a merge is remembered from frame to frame.
// At a frame's end the last elements move into the places that merges left; after as many operations
// as there are vertices, all are sorted in space.
//
// The set of operations applied when nothing is left to do is the least one that holds all that is
// needed and is closed under dependency: it depends on the criterion alone, not on what was before.
//
// The arrays after each pass are the same for any number of threads. A frame with nothing to do
// reads 24 bytes a vertex. Not thread-safe.

#include <cstdint>
#include <span>
#include <vector>

#include "methods/pmesh/active_mesh.h"
#include "methods/pmesh/criterion.h"
#include "methods/pmesh/vertex_set.h"

namespace pietra::pmesh {

struct PassCounts {
    uint32_t splits = 0, merges = 0;  ///< dummies included
    uint32_t passes = 0;              ///< that found something to do
    uint32_t operations() const { return splits + merges; }
};

class Adaption {
public:
    /// `mesh` must outlive this; validate() must find no fault in it.
    explicit Adaption(const ProgressiveMesh& mesh) : mesh_(mesh) {}

    /// A frame of at most so many passes; ends with the first that finds nothing to do.
    PassCounts frame(const Criterion& criterion, int most_passes);
    PassCounts pass(const Criterion& criterion) { return frame(criterion, 1); }
    /// Passes until nothing is left to do.
    PassCounts settle(const Criterion& criterion) { return frame(criterion, 1 << 30); }

    const ActiveMesh& mesh() const { return mesh_; }

private:
    struct Split {
        uint32_t v, u;
        std::array<uint32_t, 2> face;
    };
    /// v: kNoCorner if it is not to be; equal to u: of a dummy.
    struct Merge {
        uint32_t v, u;
        std::array<uint32_t, 2> face;
    };

    /// What a blocker hinders: a split, the undoing of the operation that made this u, or, known at
    /// its v, of the operation that is the last of v.
    enum Blocked : uint8_t { kSplit, kMerge, kMergeOfOther };

    void scan();
    void findSplits();
    void forceAround(uint32_t v, const Star& star);
    void findMerges();
    void findMerges(std::span<const uint32_t> candidates, std::span<Merge> merges);
    bool allowsMerge(uint32_t end, const Star& star, uint32_t u, uint32_t& v);
    void findOthers();
    void block(uint32_t v, uint32_t by, Blocked what);
    void setBlockedInAllViews(uint32_t u, bool blocked);
    void wakeAround(uint32_t v, const Star& star, uint32_t name);
    void wake(uint32_t v, uint32_t name);
    void markIfNeeded(uint32_t v);
    void placeSplits();
    void prefetch(uint32_t v, OperationId id) const;
    void applySplits(std::span<Split> splits);
    void applyMerges(std::span<Merge> merges);
    void applyMerge(Merge& merge);
    void apply();
    void tidy();

    ActiveMesh mesh_;
    Criterion criterion_;
    VertexSet marked_;      ///< needed, or needed by a neighbour
    VertexSet fresh_;       ///< marked, not looked at yet, or not since what hindered it changed
    VertexSet may_split_;
    VertexSet may_merge_;   ///< the last operation is not needed: to be looked at
    VertexSet look_for_other_;  ///< their u is to be looked at
    std::vector<uint32_t> list_;
    std::vector<Split> split_;
    std::vector<Merge> merge_;
    std::vector<uint32_t> free_vertex_, free_face_;
    size_t since_sort_ = 0;  ///< operations
};

}  // namespace pietra::pmesh
