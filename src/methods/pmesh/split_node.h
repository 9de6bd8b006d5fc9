#pragma once
// Nodes: vertex splits as they lie on disk and come and go at run time (Derzapf et al. 2011,
// sections 3.1 and 3.2), named by leaves (docs/design/pmesh.md, "By leaves").
//
// The leaves of the forest of splits, the input's vertices, are numbered depth first, root by root,
// what hangs below v before what hangs below u. A vertex of any mesh is a range of leaves. The
// split that parts [first, end) into v = [first, name) and u = [name, end) has the name of u's
// first leaf. A triangle of the input is three leaves: its corners are, in every mesh, the active
// vertices that these hang below, and it is there while they are three. It comes with the split
// that parts the last two of them.
//
// Nodes form binary trees. The split in slot s of node n has the id n * kNodeSlots + s. Its
// children, the next splits of v and u, lie in its own node or in one of its node's two children.
// Slots: first those that the parent node (or, of a root, a base vertex) refers to, then the others
// in the order in which the slots before refer to them; so parents lie before children, and the
// slots that a node refers to in a child count from 0 without gaps, in the order of reference.
// A node says all relative to where its frontier is, so that it can be decoded by itself.
//
// Criteria are nested along dependencies: a split needs the star that its collapse made, and what
// it needs states no less. A split's criterion encloses those of its children, too; so what a
// frontier states encloses all that is in its node and below. The parent node tells that, in some
// parts, as one box would be large where one error is.
//
// Plain data.

#include <algorithm>
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
#include "multires/node.h"

namespace pietra::pmesh {

using Leaf = uint32_t;
inline constexpr Leaf kNoLeaf = ~0u;
using SplitId = uint32_t;
inline constexpr SplitId kNoSplit = ~0u;
inline constexpr uint32_t kMaxNeighbours = 15;  ///< of a vertex that splits

/// An error, a box and a box of normals, rounded outwards; in the grid's units (SplitGrid).
struct NestedCriterion {
    std::array<uint16_t, 3> min{}, max{};
    uint16_t error = 0;  ///< the upper half of a float; 0: nothing is ever needed here
    NormalBox normals;   ///< of all there are where the component is not closed

    static constexpr uint16_t kEver = 0x7f80;  ///< infinite: needed in every view
    static uint16_t errorUp(float error) {
        const auto bits = std::bit_cast<uint32_t>(error);
        return uint16_t((bits + 0xffff) >> 16);
    }
    static float errorOf(uint16_t error) { return std::bit_cast<float>(uint32_t(error) << 16); }
    bool encloses(const NestedCriterion& other) const {
        for (size_t k = 0; k < 3; ++k)
            if (min[k] > other.min[k] || max[k] < other.max[k]) return false;
        return error >= other.error && normals.encloses(other.normals);
    }
    /// The least that encloses both.
    NestedCriterion joined(const NestedCriterion& other) const {
        NestedCriterion c = *this;
        for (size_t k = 0; k < 3; ++k) {
            c.min[k] = std::min(min[k], other.min[k]);
            c.max[k] = std::max(max[k], other.max[k]);
        }
        c.error = std::max(error, other.error);
        c.normals.add(other.normals);
        return c;
    }
    /// The largest that both enclose; maybe one of nothing, which is good enough to be nested.
    NestedCriterion within(const NestedCriterion& other) const {
        NestedCriterion c;
        for (size_t k = 0; k < 3; ++k) {
            c.min[k] = std::max(min[k], other.min[k]);
            c.max[k] = std::min(max[k], other.max[k]);
            c.normals.set(k, std::max(normals.low(k), other.normals.low(k)),
                          std::min(normals.high(k), other.normals.high(k)));
        }
        c.error = std::min(error, other.error);
        return c;
    }
    bool operator==(const NestedCriterion&) const = default;
};

/// Where criteria are: a unit is 2^shift steps of the lattice (a step is 2^Lattice::shift of its
/// units), the origin is in steps. All boxes lie within 0 and 0xffff units.
struct SplitGrid {
    int shift = 0;
    Vec3i origin{0, 0, 0};
    double unit(const Lattice& lattice) const {
        return double(uint64_t(1) << (lattice.shift + shift));
    }
    bool operator==(const SplitGrid&) const = default;
};

/// What a split states. Its box reaches, in multiples of 2^scale units, so far from the unsplit
/// vertex's cell of that size; a larger box has no smaller scale, so boxes that are rounded
/// outwards to such cells are nested as they were before.
struct LocalCriterion {
    std::array<uint8_t, 3> below{}, above{};
    uint8_t scale = 0;
    NormalBox normals;
    uint16_t error = 0;
    static constexpr int kMostScale = 16, kScaleBits = 5;
    NestedCriterion at(const Vec3i& position, const SplitGrid& grid) const {
        const Vec3i cell = cellOf(position, grid) >> int(scale);
        NestedCriterion c;
        for (size_t k = 0; k < 3; ++k) {
            // Wherever damage takes the vertex, it is a number.
            const auto unit = [&](int32_t cells) {
                return uint16_t(std::clamp(int64_t(cells) << scale, int64_t(0), int64_t(0xffff)));
            };
            c.min[k] = unit(cell[int(k)] - int32_t(below[k]));
            c.max[k] = unit(cell[int(k)] + int32_t(above[k]));
        }
        c.error = error;
        c.normals = normals;
        return c;
    }
    /// Of a box that has the vertex's cell in it.
    static LocalCriterion of(const NestedCriterion& c, const Vec3i& position,
                             const SplitGrid& grid) {
        LocalCriterion local;
        int32_t size = 0;
        for (size_t k = 0; k < 3; ++k) size = std::max(size, int32_t(c.max[k]) - c.min[k]);
        local.scale = uint8_t(std::max(int(std::bit_width(uint32_t(size))) - kScaleBits, 0));
        const Vec3i cell = cellOf(position, grid) >> int(local.scale);
        for (size_t k = 0; k < 3; ++k) {
            const int32_t up = (1 << local.scale) - 1;
            local.below[k] = uint8_t(cell[int(k)] - (c.min[k] >> local.scale));
            local.above[k] = uint8_t(((c.max[k] + up) >> local.scale) - cell[int(k)]);
        }
        local.error = c.error;
        local.normals = c.normals;
        return local;
    }
    bool operator==(const LocalCriterion&) const = default;

private:
    static Vec3i cellOf(const Vec3i& position, const SplitGrid& grid) {
        constexpr int32_t kFar = 1 << 24;
        return (glm::clamp(position, -kFar, kFar) - grid.origin) >> grid.shift;
    }
};

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

/// A vertex as it is drawn: position in steps, and packNormal() of its normal.
struct SplitVertex {
    Vec3i position{0, 0, 0};
    uint16_t normal = 0;
    bool operator==(const SplitVertex&) const = default;
};

/// A split in its node.
struct VertexSplit {
    /// 0 to 681: a slot of the own node; 682 to 1363 and 1364 to 2045: of child 0 and child 1;
    /// kNoChildSplit: none, and that end is a single leaf.
    std::array<uint16_t, 2> child;
    std::array<uint32_t, 2> leaves;  ///< below v and below u, at least one each
    /// A triangle that it brings: its corners, as leaves counted from v's first, from u's first,
    /// and, the third, from u's first, too (it lies outside of v and u, on either side).
    struct Corners {
        uint32_t v = 0, u = 0;
        int32_t w = 0;
        bool operator==(const Corners&) const = default;
    };
    std::array<Corners, 2> corner;  ///< of (v, u, w) and of (u, v, w), where `brings` has the bit
    uint8_t brings = 0;             ///< kLeft | kRight | kClosed
    static constexpr uint8_t kLeft = 1, kRight = 2;
    static constexpr uint8_t kClosed = 4;  ///< they are of a closed component
    std::array<uint16_t, 2> normal;        ///< of v and u after it
    std::array<Vec3i, 2> offset;           ///< from the unsplit vertex to v and u, in steps, exact
    LocalCriterion criterion;
    bool operator==(const VertexSplit&) const = default;
};

/// The splits of one node: 3 * 682 codes and one that means none fit 11 bits.
inline constexpr uint32_t kSplitSlots = 682;
inline constexpr uint16_t kNoChildSplit = 2047;
inline constexpr uint32_t kMostParts = 16;  ///< of a frontier
constexpr SplitId splitId(NodeIndex node, uint32_t slot) {
    return node * kSplitSlots + slot;
}
constexpr NodeIndex nodeOfSplit(SplitId id) {
    return id / kSplitSlots;
}
constexpr uint32_t slotOfSplit(SplitId id) {
    return id % kSplitSlots;
}

/// A node as its page is decoded.
struct SplitNode {
    std::vector<VertexSplit> split;  ///< at most kSplitSlots
    uint32_t frontier = 0;           ///< how many, the first ones, are referred to from above
    /// Of each child node: what the splits of its frontier state, in parts of them; each is
    /// enclosed by one.
    std::array<std::vector<NestedCriterion>, 2> child_parts;
    WordLayout layout;
    std::vector<uint32_t> word;  ///< for each split those of v, then of u, after it
    bool operator==(const SplitNode&) const = default;
};

/// What is known of a node without its page.
struct SplitRow {
    NodeIndex parent = kNoNode;
    std::array<NodeIndex, 2> child{kNoNode, kNoNode};
    uint32_t splits = 0;
    uint16_t level = 0;         ///< in the tree of nodes: 0 for roots
    NestedCriterion criterion;  ///< encloses those of all splits in it and below
    bool operator==(const SplitRow&) const = default;
};

/// The coarsest mesh: roots in the order of their leaves, which count from 0 without gaps.
struct SplitBase {
    struct Root {
        SplitVertex vertex;
        uint32_t leaves = 1;
        SplitId split = kNoSplit;  ///< in the frontier of a root node
        bool operator==(const Root&) const = default;
    };
    std::vector<Root> root;
    std::vector<std::array<Leaf, 3>> triangle;  ///< that are always there
    std::vector<uint8_t> closed;                ///< one a triangle, as VertexSplit::kClosed
    std::vector<uint32_t> word;                 ///< of each root
    bool operator==(const SplitBase&) const = default;
};

/// A progressive mesh as nodes: what a file holds.
struct SplitForest {
    Lattice lattice;
    SplitGrid grid;
    WordLayout layout;
    SplitBase base;
    std::vector<SplitRow> row;    ///< level by level: parents before children
    std::vector<SplitNode> node;  ///< as many, or none: not in memory
};

}  // namespace pietra::pmesh
