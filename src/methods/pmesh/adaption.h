#pragma once
// Parallel adaption (Derzapf et al. 2011, section 4.2): passes over the active mesh, each of which
// applies all operations that may be applied at once.
//
// A frame looks at all vertices once, for what the criterion needs and for what it does not need
// any more. A pass, from the state before it:
//   1. A marked vertex with a neighbour of a lower level must wait: mark that neighbour. So on, in
//      rounds over those newly marked, until there are none. A marked one without may split.
//   2. An operation that is not needed may be undone if it is the last of both its vertices, and no
//      other neighbour's last one has its level or a higher one. Where both meet, splits win: no
//      vertex around may be marked.
//   3. All splits and merges are done, new elements in free places, in the order of the vertices.
// Each vertex counts the neighbours that it must wait for (VertexPulse::around); when none is left,
// it is looked at in the next pass. So passes go on from what the last one changed.
// At a frame's end the last elements move into the places that merges left; a frame after many
// operations begins with sorting all in space.
//
// The set of operations applied when nothing is left to do is the least one that holds all that is
// needed and is closed under dependency: it depends on the criterion alone, not on what was before.
//
// Where some nodes of operations are not loaded, what they would split stays marked, and so nothing
// around it merges; all of that is told (waiting()). To undo never takes a node that is not loaded,
// as long as nodes with applied operations stay.
//
// The arrays after each pass are the same for any number of threads. A frame with nothing to do
// reads 24 bytes a vertex. Not thread-safe.

#include <algorithm>
#include <atomic>
#include <cstdint>
#include <limits>
#include <span>
#include <vector>

#include "methods/pmesh/active_mesh.h"
#include "methods/pmesh/criterion.h"
#include "methods/pmesh/vertex_set.h"

namespace pietra::pmesh {

struct PassCounts {
    uint32_t splits = 0, merges = 0;  ///< dummies included
    uint32_t passes = 0;              ///< that found something to do
    bool finished = false;       ///< nothing is left to do with the nodes and the room there is
    bool short_of_room = false;  ///< there are no vertices for all splits
    uint32_t operations() const { return splits + merges; }
};

/// What a frame may take; it does one pass in any case.
struct FrameLimits {
    int passes = 1 << 30;
    double milliseconds = std::numeric_limits<double>::infinity();  ///< then no pass begins
    size_t operations = ~size_t(0);                                 ///< of a pass, of each kind
    size_t vertices = ~size_t(0);                                   ///< of the mesh, at any time
};

/// Operations scatter what belongs together over the arrays; after some, sorting pays.
class Wear {
public:
    void add(size_t operations) { since_sort_ += operations; }
    /// If so, they are to be sorted.
    bool takeIfOver(size_t vertices) {
        const bool over = since_sort_ > std::max(kLeast, 4 * vertices);
        if (over) since_sort_ = 0;
        return over;
    }

private:
    static constexpr size_t kLeast = 4096;  ///< what fits the second-level cache needs none
    size_t since_sort_ = 0;
};

class Adaption {
public:
    /// `mesh` must outlive this; validate() must find no fault in it.
    explicit Adaption(const ProgressiveMesh& mesh, const References* references = nullptr)
        : mesh_(mesh, references) {}

    /// Ends with the first pass that finds nothing to do.
    PassCounts frame(const Criterion& criterion, const FrameLimits& limits);
    PassCounts frame(const Criterion& criterion, int most_passes) {
        return frame(criterion, FrameLimits{.passes = most_passes});
    }
    PassCounts pass(const Criterion& criterion) { return frame(criterion, 1); }
    /// Passes until nothing is left to do.
    PassCounts settle(const Criterion& criterion) { return frame(criterion, 1 << 30); }

    const ActiveMesh& mesh() const { return mesh_; }
    /// Between frames: for what is drawn of it.
    ActiveMesh& mesh() { return mesh_; }

    /// An operation that is marked at the end of the last frame, or that is to be known.
    struct Waiting {
        OperationId operation;
        bool is_needed;  ///< or only before one that is
    };
    std::span<const Waiting> waiting() const { return waiting_; }

    /// Operations found not to fit the mesh, so far: the model is damaged. They are left undone.
    uint32_t refused() const { return refused_; }

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
    using Some = std::span<const uint32_t>;

    bool isNeeded(uint32_t u) const;
    void scan();
    uint64_t withoutProvisional(size_t w, uint64_t needed);
    void maySplit(uint32_t v);
    void findSplits(const FrameLimits& limits);
    void findSplits(Some fresh);
    void postpone(size_t from, VertexSet& set);
    void placeSplits();
    void mark(uint32_t v);
    void findCandidates();
    void setBlocked(uint32_t u, bool blocked);
    void findMerges(size_t most);
    bool isAlone(const Merge& merge, const Star& star, const Star& other) const;
    void findMerges(Some candidates, std::span<Merge> merges);
    void prefetchOtherEnds(Some vertices) const;
    bool anyMarkedAround(uint32_t v) const;
    void prefetch(uint32_t v, OperationId id) const;
    void gather(Some vertices, Star* stars) const;
    void applySplits(std::span<Split> splits);
    void wakeAround(const Star& star, uint32_t v, uint32_t at);
    void applyMerges(std::span<Merge> merges);
    void apply();
    void listWaiting();
    void tidy();

    ActiveMesh mesh_;
    Criterion criterion_;
    VertexSet marked_;  ///< needed, or needed by a neighbour
    VertexSet fresh_;   ///< marked, not looked at yet
    VertexSet may_split_;
    VertexSet released_;   ///< no neighbour's last level is higher any more
    VertexSet unknown_;    ///< unmarked, but what is known of the next split would be needed
    VertexSet may_merge_;  ///< the last operation, which made them, is not needed
    bool none_marked_ = false;
    std::vector<uint32_t> list_;
    std::vector<Waiting> waiting_;
    std::vector<Split> split_;
    std::vector<Merge> merge_;
    std::vector<uint32_t> free_vertex_, free_face_;
    Wear wear_;
    bool short_of_room_ = false;
    std::atomic<uint32_t> refused_{0};
};

}  // namespace pietra::pmesh
