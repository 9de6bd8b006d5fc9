#pragma once
// The progressive mesh: a base mesh and a forest of vertex splits (Derzapf, Menzel, Guthe 2011,
// section 3; Hoppe 1997).
//
// Operation o splits an active vertex v into v, which keeps its name, and u, which is new:
//
//            . vl .                          fl = (v, u, vl), fr = (u, v, vr)
//          .   / \   .
//         .   /   \   .                      Counter-clockwise around the unsplit vertex: from vr
//     v's    v --- u    u's                  to vl lie u's triangles, from vl to vr those of v.
//         .   \   /   .
//          .   \ /   .                       At a border, vl or vr may be missing.
//            . vr .
//
// Names: a vertex of the base mesh has its index, the u of operation o is base vertex count + o.
//
// Levels order an operation against what else may stand around it: v may split if and only if its
// level is below the level of the next split of each neighbour (kLeafLevel where there is none).
// Then its star is exactly the one that the encoder saw (docs/design/pmesh.md), so vl and vr are
// told by their ranks in it: neighbours are counted counter-clockwise, from the one of the least
// name, or at a border from its beginning. In an oriented fan the paper's sixteen flag bits follow
// from these two ranks.
//
// A dummy operation has no u: it moves v by an offset of sixteen bits, where those of the operation
// before were too coarse for the edges around.
//
// All positions are integers, in *steps* of 2^Lattice::shift, so that a collapse undoes its split
// exactly. Criteria are saturated: an operation's error is no less, and its sphere and its box of
// normals enclose those, of the operations below it, also after rounding.
//
// Plain data, immutable once built; any number of threads may read it.

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/lattice.h"
#include "geometry/mesh.h"
#include "methods/pmesh/normal_box.h"
#include "methods/pmesh/vertex_words.h"

namespace pietra::pmesh {

using OperationId = uint32_t;
inline constexpr OperationId kNoOperation = ~0u;

/// The operations of one node (operation_node.h): 3 * 682 codes and two that mean none fill 11
/// bits.
inline constexpr uint32_t kNodeSlots = 682;
inline constexpr uint32_t kMaxNeighbours = 15;  ///< of a vertex that splits
inline constexpr uint32_t kNoRank = 15;
inline constexpr uint32_t kMaxLevel = 1022;
inline constexpr uint32_t kLeafLevel = 1023;

// ---- small numbers

/// A float of a byte or two, without sign or fraction: `kMantissa` bits and an exponent.
/// Monotone in the code; codes below 2^kMantissa are themselves.
template <uint32_t kMantissa>
constexpr uint64_t decodeRounded(uint32_t code) {
    const uint32_t exponent = code >> kMantissa;
    if (exponent == 0) return code;
    return uint64_t((1u << kMantissa) | (code & ((1u << kMantissa) - 1))) << (exponent - 1);
}

/// The least code whose value is at least `value`.
template <uint32_t kMantissa>
constexpr uint32_t encodeRoundedUp(uint64_t value) {
    if (value < (1u << kMantissa)) return uint32_t(value);
    uint32_t exponent = uint32_t(std::bit_width(value)) - kMantissa;
    const uint64_t mantissa = (value + (uint64_t(1) << (exponent - 1)) - 1) >> (exponent - 1);
    return uint32_t((exponent << kMantissa) + (mantissa - (1u << kMantissa)));
}

/// Errors are stored in units of 1/64 step, 3 bits of mantissa; radii in steps, 11 bits.
inline constexpr double kErrorUnit = 1.0 / 64;
constexpr uint64_t decodeError(uint32_t code) {
    return decodeRounded<3>(code);
}
constexpr uint32_t decodeRadius(uint32_t code) {
    return uint32_t(decodeRounded<11>(code));
}
inline constexpr uint32_t kMaxErrorCode = 255, kMaxRadiusCode = encodeRoundedUp<11>(1 << 23);

/// A normal in two bytes: the octahedron's coordinates to 7 bits and sign.
constexpr uint16_t packNormal(OctNormal n) {
    const auto narrow = [](int32_t x) {
        return uint32_t((x * 254 + (x < 0 ? -32767 : 32767)) / 65534) & 0xff;
    };
    return uint16_t(narrow(n.x) | narrow(n.y) << 8);
}
constexpr OctNormal unpackNormal(uint32_t packed) {
    const auto widen = [](uint32_t byte) { return int16_t(int32_t(int8_t(byte)) * 258); };
    return {widen(packed & 0xff), widen(packed >> 8 & 0xff)};
}

// ---- operations

struct Operation {
    /// The next splits of v and of u, kNoOperation: none. Of a dummy: that of v, and the operation
    /// that v came from, which elsewhere u remembers.
    std::array<OperationId, 2> child;
    uint16_t level;   ///< at most kMaxLevel, below the children's
    uint16_t radius;  ///< of the saturated sphere around the unsplit vertex
    uint8_t error;    ///< saturated; 0: there is no operation
    uint8_t ranks;    ///< of vl in the lower, of vr in the upper four bits
    uint8_t shift;    ///< of the deltas
    std::array<std::array<int8_t, 3>, 2> delta;  ///< from the unsplit vertex to v, to u: << shift
    NormalBox normals;  ///< saturated: of the faces around before and after the split, and below
    std::array<uint16_t, 2> normal;  ///< of v and of u after the split

    uint32_t rankLeft() const { return ranks & 15u; }
    uint32_t rankRight() const { return ranks >> 4; }
    static constexpr uint8_t kDummyRanks = kNoRank | kNoRank << 4;
    bool isDummy() const { return ranks == kDummyRanks; }
    OperationId childOf(int end) const {
        return end == 1 && isDummy() ? kNoOperation : child[size_t(end)];
    }
    /// From the unsplit vertex to v (0) or u (1), in steps.
    Vec3i offset(int end) const {
        const auto& d = delta[size_t(end)];
        if (isDummy()) return wideOffset();
        return Vec3i(d[0], d[1], d[2]) * (1 << shift);
    }
    /// Of a dummy: the upper bytes first.
    Vec3i wideOffset() const {
        const auto wide = [&](size_t k) { return delta[0][k] * 256 + uint8_t(delta[1][k]); };
        return Vec3i(wide(0), wide(1), wide(2)) * (1 << shift);
    }
    bool operator==(const Operation&) const = default;
};
static_assert(sizeof(Operation) == 28);

/// A vertex as it is drawn: position in steps, and the packed normal in the lower half.
struct Vertex {
    int32_t x, y, z;
    uint32_t normal;
    Vec3i position() const { return {x, y, z}; }
    void moveBy(const Vec3i& d) { x += d.x, y += d.y, z += d.z; }
    bool operator==(const Vertex&) const = default;
};

struct ProgressiveMesh {
    Lattice lattice;
    std::vector<Vertex> base_vertex;
    std::vector<Triangle> base_triangle;
    /// One a base triangle: 1 where the input's component is closed, consistently oriented and not
    /// inside out. Empty: nothing is known.
    std::vector<uint8_t> base_closed;
    std::vector<OperationId> base_operation;  ///< the first split of each base vertex, or none
    /// Parents before children; nodes (operation_node.h) have gaps between them, without
    /// operations.
    std::vector<Operation> operation;
    /// Where only some nodes are in memory: the place of each, counted in nodes, or kNotLoaded.
    /// Empty: all operations lie at their ids.
    std::vector<uint32_t> place_of_node{};
    WordLayout layout{};
    std::vector<uint32_t> base_word{};
    std::vector<uint32_t> word{};  ///< as OperationNode has them, in the places of operations
    static constexpr uint32_t kNotLoaded = ~0u;

    uint32_t nameOf(OperationId o) const { return uint32_t(base_vertex.size()) + o; }
    bool isLoaded(OperationId o) const {
        return place_of_node.empty() || place_of_node[o / kNodeSlots] != kNotLoaded;
    }
    uint64_t placeOf(OperationId o) const {
        return place_of_node.empty()
                   ? o
                   : uint64_t(place_of_node[o / kNodeSlots]) * kNodeSlots + o % kNodeSlots;
    }
    /// Of the vertex `name`, whose last split `last` is loaded, or none.
    std::span<const uint32_t> wordsOf(uint32_t name, OperationId last) const {
        const size_t words = layout.words();
        if (last == kNoOperation) return std::span(base_word).subspan(words * name, words);
        return std::span(word).subspan(words * (2 * placeOf(last) + size_t(name == nameOf(last))),
                                       words);
    }
    /// It must be loaded.
    const Operation& at(OperationId o) const { return operation[placeOf(o)]; }
};

/// What is known of an operation that is not loaded: its level, and criteria that enclose its own.
struct Reference {
    uint16_t level;
    uint16_t radius;
    uint8_t error;
    Vec3i centre;
};
class References {
public:
    virtual ~References() = default;
    /// Of the next split of an active vertex.
    virtual Reference referenceTo(OperationId id) const = 0;
};

/// The operations that there are, by level and id: in this order, each finds the star it was
/// encoded for.
std::vector<OperationId> coarseToFine(const ProgressiveMesh& mesh);

/// Empty if levels, ranks and the like are within their ranges, children apart.
[[nodiscard]] std::string faultOf(const Operation& o);
/// The child at this end does not exceed the criteria of the one above it.
[[nodiscard]] bool criteriaNest(const Operation& parent, const Operation& child, int end);

/// Empty if the forest keeps its rules: each operation has one parent, before it, of a lower level
/// and no smaller criteria; levels, ranks and the base mesh's indices are within their ranges. Else
/// a sentence about the first fault. Never throws, whatever the mesh holds.
[[nodiscard]] std::string validate(const ProgressiveMesh& mesh);

}  // namespace pietra::pmesh
