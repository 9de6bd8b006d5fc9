#pragma once
// What encoder and decoder of page body 1 share: the sequences of the body, a patch in the order of
// the traversal, and the prediction of its normals. Internal to src/store.

#include <array>
#include <span>
#include <vector>

#include "store/front_predict.h"
#include "store/page_format.h"

namespace pietra {

// Sequences, in the order of the file.
enum Sequence : size_t {
    kPatchCounts,     // border loops, closed components, copies: three a patch
    kLoopLengths,     // one a border loop
    kBorderValences,  // one a border vertex, two a closed component
    kShared,          // one a border vertex that is no copy: see SharedVertex
    kSymbols,         // what FrontWalk asks for
    kSplitTargets,
    kSplitParts,
    kCopies,       // fan vertices that are another one over again: distance to the copy before
    kCopyOrigins,  // how far before the copy its original is
    kBorderX,      // three, units of 2^shift
    kInteriorU = kBorderX + 3,  // three, units of 2^(shift + m)
    kBorderNormalX = kInteriorU + 3,
    kBorderNormalY,
    kNormalX,
    kNormalY,
    kEdgeClasses,     // one a triangle; none if all are 0
    kAttributeValues  // r, g, b, a where there are colours, then the scalars
};

inline size_t sequenceCount(const PageHeader& header) {
    return kAttributeValues + (header.colours ? 4 : 0) + size_t(header.scalar_count);
}

/// A split names its target by steps along the front, alternately away from the two ends of the
/// gate, or, from this code on, by its item.
inline constexpr uint32_t kSplitSteps = 240;

/// A border vertex of a patch, as the patches after it in the page may refer to it, instead of
/// saying again what it carries. Neighbours run along their common border in opposite directions,
/// so the one wanted next is most often the one before the last.
struct SharedVertex {
    Lanes at;
    uint32_t patch;
    uint32_t vertex;  ///< of the patch
    uint32_t before;  ///< the one before it in its loop
};
// What a border vertex says of this: it is new, it is the one wanted, or, from kSharedByDistance
// on, how far back it lies from the end of the list of all border vertices of the patches before.
inline constexpr uint32_t kSharedNot = 0;
inline constexpr uint32_t kSharedAsExpected = 1;
inline constexpr uint32_t kSharedByDistance = 2;

/// A patch in the order of the traversal; indices are fan vertices in the order of their
/// appearance, border vertices first.
struct FrontPatch {
    FrontItems items;
    std::vector<Lanes> position;  ///< units of 2^shift
    std::vector<Triangle> triangle;
    /// Two earlier neighbours of each vertex, from which attributes are predicted; itself at the
    /// start.
    std::vector<std::array<uint32_t, 2>> parents;
    std::vector<uint32_t> shared;  ///< a border vertex's place in the list of shared ones, or kNone
    std::vector<uint32_t> loop_begin;  ///< first vertices of the border loops
    uint32_t border_vertices = 0;
    uint32_t vertices =
        0;  ///< so far: position, triangle, parents have their final sizes all along
    uint32_t triangles = 0;

    void reset(size_t vertex_count, size_t triangle_count);
    uint32_t addVertex(Lanes at, uint32_t parent_a, uint32_t parent_b) {
        position[vertices] = at;
        parents[vertices] = {parent_a, parent_b};
        return vertices++;
    }
    /// Links items first to items.size() - 1 into a loop without triangles behind it.
    void closeLoop(uint32_t first);
};

/// Appends the patch's border vertices to the page's list. `final_vertex` maps fan vertices to the
/// vertices of the mesh; empty: they are the same.
void appendShared(const FrontPatch& patch, uint32_t patch_index,
                  std::span<const uint32_t> final_vertex, std::vector<SharedVertex>& list);

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

/// Octahedral codes of the area-weighted normals of a patch's geometry, as predictions of the true
/// ones: at `bits` a component, one pair a vertex. Float, one rounding an operation, sums in the
/// order of the triangles.
class NormalPredictor {
public:
    void predict(std::span<const Lanes> position, std::span<const Triangle> triangles, int bits);
    std::span<const int32_t> x() const { return x_; }
    std::span<const int32_t> y() const { return y_; }

private:
    std::vector<Lanes> sum_;
    std::vector<int32_t> x_, y_;
};

}  // namespace pietra
