#pragma once
// How active vertices lie in memory: 32 a page, in columns where vectors read them.

#include <array>
#include <cstdint>

#include "methods/pmesh/split_view.h"

namespace pietra::pmesh {

inline constexpr uint32_t kPageVertices = 32;

/// Criteria of 32 splits.
struct CriterionPage {
    std::array<std::array<uint16_t, kPageVertices>, 3> min, max;
    std::array<uint16_t, kPageVertices> error;
    std::array<NormalBox, kPageVertices> normals;
    void set(uint32_t i, const NestedCriterion& c) {
        for (size_t k = 0; k < 3; ++k) min[k][i] = c.min[k], max[k][i] = c.max[k];
        error[i] = c.error;
        normals[i] = c.normals;
    }
    NestedCriterion get(uint32_t i) const {
        NestedCriterion c;
        for (size_t k = 0; k < 3; ++k) c.min[k] = min[k][i], c.max[k] = max[k][i];
        c.error = error[i];
        c.normals = normals[i];
        return c;
    }
};

/// A slot is an active vertex, with the split that it is named after.
struct alignas(4096) SplitPage {
    // What each frame reads.
    CriterionPage birth;  ///< of the split that it came with
    CriterionPage next;   ///< of its next split; error 0 where there is none
    uint32_t alive;       ///< a bit a slot
    uint32_t dropped;     ///< in this frame
    uint32_t opened;      ///< to be split
    uint32_t grown;       ///< their next split is another one
    uint32_t closed;      ///< their triangles are of a closed component
    // What operations read.
    std::array<SplitId, kPageVertices> split;  ///< its next one, or kNoSplit
    std::array<Leaf, kPageVertices> first;     ///< its first leaf
    std::array<SplitId, kPageVertices> made;   ///< the one that it came with, or kNoSplit: a root
    std::array<Leaf, kPageVertices> last;      ///< the name of the split above, or kNoLeaf
    std::array<Leaf, kPageVertices> parent;    ///< of the one above that which it came with
    std::array<SplitVertex, kPageVertices> vertex;
    std::array<SplitVertex, kPageVertices> merged;        ///< what undoing that makes of v
    std::array<std::array<Leaf, 6>, kPageVertices> leaf;  ///< of the triangles it came with
};
static_assert(sizeof(SplitPage) == 4096);

/// A bit a slot: the view needs what it states.
struct PageNeeds {
    uint32_t birth = 0, next = 0;
};
PageNeeds scanPage(const SplitView& view, const SplitPage& page);
/// PageNeeds::next alone.
uint32_t scanNext(const SplitView& view, const SplitPage& page);

}  // namespace pietra::pmesh
