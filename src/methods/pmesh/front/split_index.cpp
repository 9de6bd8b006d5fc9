#include "methods/pmesh/front/split_index.h"

#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "methods/pmesh/front/split_index.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

// Loops of plain code: it is the instruction that counts bits which targets differ in.
HWY_BEFORE_NAMESPACE();
namespace pietra::pmesh::HWY_NAMESPACE {

uint32_t number(const uint64_t* bits, size_t words, uint32_t first, uint32_t* index) {
    uint32_t count = 0;
    for (size_t w = 0; w < words; ++w) {
        index[w] = first + count;
        count += uint32_t(__builtin_popcountll(bits[w]));
    }
    return count;
}

void order(const uint64_t* bits, const uint32_t* index, const uint32_t* leaf, uint32_t alive,
           uint32_t mask, uint32_t slot, uint16_t* order) {
    for (; alive != 0; alive &= alive - 1) {
        const auto i = uint32_t(__builtin_ctz(alive));
        const uint32_t word = leaf[i] / 64;
        const uint64_t before = bits[word] & ((uint64_t(1) << leaf[i] % 64) - 1);
        order[(index[word] & mask) + uint32_t(__builtin_popcountll(before))] = uint16_t(slot + i);
    }
}

void upTo(const uint64_t* bits, const uint32_t* index, const uint32_t* leaf, size_t count,
          uint32_t* number) {
    for (size_t i = 0; i < count; ++i) {
        const uint32_t word = leaf[i] / 64;
        const uint64_t until = bits[word] << (63 - leaf[i] % 64);
        number[i] = index[word] + uint32_t(__builtin_popcountll(until));
    }
}

}  // namespace pietra::pmesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra::pmesh {

HWY_EXPORT(number);
HWY_EXPORT(order);
HWY_EXPORT(upTo);

uint32_t numberWords(const uint64_t* bits, size_t words, uint32_t first, uint32_t* index) {
    return HWY_DYNAMIC_DISPATCH(number)(bits, words, first, index);
}

void orderSlots(const uint64_t* bits, const uint32_t* index, const uint32_t* leaf, uint32_t alive,
                uint32_t mask, uint32_t slot, uint16_t* out) {
    HWY_DYNAMIC_DISPATCH(order)(bits, index, leaf, alive, mask, slot, out);
}

void countUpTo(const uint64_t* bits, const uint32_t* index, std::span<const uint32_t> leaf,
               uint32_t* number) {
    HWY_DYNAMIC_DISPATCH(upTo)(bits, index, leaf.data(), leaf.size(), number);
}

}  // namespace pietra::pmesh
#endif
