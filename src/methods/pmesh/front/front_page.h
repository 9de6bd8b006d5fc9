#pragma once
// How active vertices lie in memory: 32 a page, in columns where vectors read them.

#include <array>
#include <cstdint>

#include "methods/pmesh/front/leaf_forest.h"

namespace pietra::pmesh {

inline constexpr uint32_t kPageSlots = 32;

struct CriterionColumns {
    std::array<std::array<uint16_t, kPageSlots>, 3> min, max;
    std::array<uint16_t, kPageSlots> error;
    void set(uint32_t slot, const NestedCriterion& c) {
        for (size_t k = 0; k < 3; ++k) min[k][slot] = c.min[k], max[k][slot] = c.max[k];
        error[slot] = c.error;
    }
    NestedCriterion get(uint32_t slot) const {
        NestedCriterion c;
        for (size_t k = 0; k < 3; ++k) c.min[k] = min[k][slot], c.max[k] = max[k][slot];
        c.error = error[slot];
        return c;
    }
};

/// A slot is an active vertex, with the operation that it is named after.
struct alignas(4096) FrontPage {
    CriterionColumns birth;  ///< of the operation that it came with
    CriterionColumns next;   ///< of its next split; error 0 where there is none, or no vertex
    std::array<Leaf, kPageSlots> first;   ///< its first leaf
    std::array<Leaf, kPageSlots> split;   ///< its next split, or kNoLeaf
    std::array<Leaf, kPageSlots> parent;  ///< of the operation that it came with, or kNoLeaf
    std::array<Vertex, kPageSlots> vertex;
    std::array<Vertex, kPageSlots> merged;  ///< what undoing that operation makes of v
    std::array<std::array<Leaf, 6>, kPageSlots> leaf;        ///< of the triangles it came with
    std::array<std::array<uint32_t, 6>, kPageSlots> corner;  ///< the same as slots
    /// The blocks of these leaves, some more, by their lower bits.
    std::array<uint64_t, 8> refers;
    uint32_t alive;    ///< a bit a slot
    uint32_t dropped;  ///< in this frame, and not yet merged
    uint32_t opened;   ///< to be split
    uint32_t stale;    ///< slots dropped since `refers` was exact
    uint32_t changed;  ///< 1: vertices have come since corners were looked up
};
static_assert(sizeof(FrontPage) == 4096);

}  // namespace pietra::pmesh
