#pragma once
// What encoder and decoder of page body 1 share: the sequences of the body, and the attributes of a
// patch in fan order. Internal to src/store.

#include <array>
#include <vector>

#include "store/front_predict.h"
#include "store/page_format.h"

namespace pietra {

// Sequences, in the order of the file.
enum Sequence : size_t {
    kPatchCounts,     // border loops, closed components, copies: three a patch
    kLoopLengths,     // one a border loop
    kBorderValences,  // one a border vertex
    kSymbols,         // what FrontWalk asks for
    kSplitTargets,
    kSplitParts,
    kCopies,       // fan vertices that are another one over again: distance to the copy before
    kCopyOrigins,  // how far before the copy its original is
    kBorderX,      // three, units of 2^shift
    kInteriorU = kBorderX + 3,  // three, units of 2^(shift + m)
    kNormalX = kInteriorU + 3,
    kNormalY,
    kEdgeClasses,     // one a triangle
    kAttributeValues  // r, g, b, a where there are colours, then the scalars
};

inline size_t sequenceCount(const PageHeader& header) {
    return kAttributeValues + (header.colours ? 4 : 0) + size_t(header.scalar_count);
}

/// A split names its target by steps along the front, alternately away from the two ends of the
/// gate, or, from this code on, by its item.
inline constexpr uint32_t kSplitSteps = 240;

/// A patch in the order of the traversal; indices are fan vertices in the order of their
/// appearance, border vertices first.
struct FrontPatch {
    std::vector<FrontItem> items;
    std::vector<Vec3i> position;  ///< units of 2^shift
    std::vector<Triangle> triangle;
    /// Two earlier neighbours of each vertex, from which attributes are predicted; itself at the
    /// start.
    std::vector<std::array<uint32_t, 2>> parents;
    uint32_t border_vertices = 0;
    uint32_t vertices = 0;  ///< all of them
};

inline constexpr uint8_t Rgba8::*kChannels[] = {&Rgba8::r, &Rgba8::g, &Rgba8::b, &Rgba8::a};
inline uint8_t average(uint8_t a, uint8_t b) {
    return uint8_t((a + b + 1) >> 1);
}
/// zigzag modulo 256.
inline uint8_t zigzagByte(uint8_t difference) {
    return uint8_t(difference << 1 ^ (0 - (difference >> 7)));
}
inline uint8_t unzigzagByte(uint8_t code) {
    return uint8_t(code >> 1 ^ (0 - (code & 1)));
}

/// Octahedral codes of the area-weighted normals of the patch's geometry, at `bits` a component.
/// Exactly reproducible: integers below 2^53 in double, one division a component.
void predictNormals(const FrontPatch& patch, int bits, std::vector<std::array<int32_t, 2>>& codes);

}  // namespace pietra
