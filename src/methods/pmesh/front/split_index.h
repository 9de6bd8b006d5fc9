#pragma once
// Counting bits of leaves, with what the processor has for that. `bits` has one for each leaf, set
// where an active vertex begins; `index` of each 64 leaves a number, to which those set before, of
// the same block, were added.

#include <cstddef>
#include <cstdint>
#include <span>

namespace pietra::pmesh {

/// index[w] = first + bits set in words before, of so many words. Their sum.
uint32_t numberWords(const uint64_t* bits, size_t words, uint32_t first, uint32_t* index);
/// order[(number of those before this leaf) & mask] = slot + i, for each bit i of `alive`.
void orderSlots(const uint64_t* bits, const uint32_t* index, const uint32_t* leaf, uint32_t alive,
                uint32_t mask, uint32_t slot, uint16_t* order);
/// number[i]: of those set up to leaf[i], including its own.
void countUpTo(const uint64_t* bits, const uint32_t* index, std::span<const uint32_t> leaf,
               uint32_t* number);

}  // namespace pietra::pmesh
