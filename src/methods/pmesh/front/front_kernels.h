#pragma once
// The two loops over all active vertices, in vectors. Floats, no multiply-add: the same on every
// machine. Thread-safe.

#include <atomic>

#include "methods/pmesh/front/front_page.h"
#include "multires/view.h"

namespace pietra::pmesh {

/// Which operations are needed: those whose error, at the point of their box nearest to the eye,
/// shows. Outside the picture the tolerance grows with the distance from its pyramid (criterion.h).
/// Monotone in error and box as floats round: what encloses a needed criterion is needed.
struct FrontView {
    std::array<float, 3> eye{};                 ///< grid units
    std::array<std::array<float, 3>, 4> side{};  ///< inward normals
    std::array<float, 4> at_eye{};              ///< their products with the eye
    float reach = 0;                            ///< distance from which an error of 1 shows
    static constexpr float kOutside = 8;
};

/// Needed is what shows as more than `pixels`.
FrontView frontView(const View& view, const LeafForest& forest, double pixels);
/// All operations, or none.
FrontView wholeView(bool all);

struct PageScan {
    uint32_t birth = 0, next = 0;  ///< a bit a slot: needed
};
PageScan scanPage(const FrontView& view, const FrontPage& page);
/// PageScan::next alone.
uint32_t scanSplits(const FrontView& view, const FrontPage& page);

/// What another thread may change, in bits that nobody here asks for.
template <class T>
T loadRelaxed(const T& x) {
    return std::atomic_ref(const_cast<T&>(x)).load(std::memory_order_relaxed);
}
template <class T>
void storeRelaxed(T& x, T value) {
    std::atomic_ref(x).store(value, std::memory_order_relaxed);
}

/// Where the active vertices are.
struct FrontIndex {
    /// A bit a leaf: an active vertex begins there. kBefore words of zeros lie before.
    const uint64_t* active;
    /// The slot of the vertex that begins there, in its block.
    const uint16_t* slot;
    /// One a block: how many vertices begin there.
    const uint32_t* count;
    static constexpr size_t kBefore = 1;
};
inline constexpr uint32_t kBlockBits = 11, kBlockLeaves = 1u << kBlockBits;

/// The vertex that a leaf hangs below. Leaf 0 begins one always.
Leaf ownerOf(const FrontIndex& index, Leaf leaf);
/// slot[i]: of the vertex that leaf[i] hangs below; counted through all blocks, kBlockLeaves each.
/// `count`: a multiple of 16.
void findSlots(const FrontIndex& index, const Leaf* leaf, uint32_t* slot, size_t count);

}  // namespace pietra::pmesh
