#pragma once
// A progressive mesh whose operations name each other by leaves (docs/design/pmesh.md, "By
// leaves").
//
// The leaves of the forest of vertex splits, the input's vertices, are numbered depth first, what
// hangs below v before what hangs below u. A vertex of any mesh is a range of leaves, [first, end).
// The operation that parts two ranges has the name of u's first leaf. So the applied operations,
// with the first leaves of the roots, are the first leaves of the active vertices.
//
// A triangle of the input is three leaves. It is there while they hang below three different active
// vertices: it comes with the operation that parts the last two of them, which keeps it. No
// operation brings more than two.
//
// Criteria are nested along dependencies. A split needs the star that its collapse made: that the
// collapses that came next to each vertex of it are undone. Its error is no less than that of any
// operation that needs it, and its box encloses theirs. So what a view needs brings all that it
// needs, and each operation decides by itself.
//
// Plain data, immutable once built; any number of threads may read it.

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

#include "base/budget.h"
#include "geometry/lattice.h"
#include "geometry/mesh.h"
#include "methods/pmesh/front/huge_memory.h"
#include "methods/pmesh/operations.h"
#include "methods/pmesh/split_node.h"

namespace pietra::pmesh {

/// All of an operation that a split and its undoing need.
struct alignas(8) LeafSplit {
    std::array<Leaf, 2> child;         ///< the next splits of v and u, or kNoLeaf
    Leaf parent;                       ///< or kNoLeaf
    std::array<Leaf, 6> corner;        ///< of the triangles it brings; three equal: none
    std::array<Vertex, 2> vertex;      ///< v and u after it
    std::array<NestedCriterion, 2> criterion;  ///< of the children
};
static_assert(sizeof(LeafSplit) == 104);

struct LeafRoot {
    Leaf first;
    Leaf split;  ///< or kNoLeaf
    NestedCriterion criterion;
    Vertex vertex;
};

struct LeafForest {
    Lattice lattice;
    /// A grid unit is 2^grid_shift steps; its origin in steps.
    int grid_shift = 0;
    Vec3i grid_origin{0, 0, 0};
    std::vector<LeafSplit, HugeAllocator<LeafSplit>> split;  ///< by leaf; unused where a root begins
    std::vector<LeafRoot> root;    ///< in the order of leaves
    std::vector<Leaf> base_corner;  ///< three a triangle that is always there

    size_t leaves() const { return split.size(); }
    double gridUnit() const { return double(uint64_t(1) << (lattice.shift + grid_shift)); }
};

/// What one simplification from end to end did.
struct CollapseLog {
    struct Collapse {
        uint32_t v, u;  ///< u goes
        std::array<Vertex, 2> before;
        Vertex after;
        float error;  ///< lattice units
        uint8_t neighbours = 0, triangles = 0;
        std::array<uint32_t, kMaxNeighbours> neighbour;  ///< of the merged vertex
        std::array<uint32_t, 2> triangle;                ///< that it removes
    };
    Lattice lattice;
    std::vector<Triangle> triangle;  ///< the input's
    std::vector<Vertex> vertex;
    std::vector<Collapse> collapse;
};

/// As buildInCore().
CollapseLog logCollapses(Mesh mesh, const Lattice& lattice, Budget& budget);

/// `leaf_of`: of each vertex of the input, if not null.
LeafForest makeLeafForest(const CollapseLog& log, std::vector<Leaf>* leaf_of = nullptr);

}  // namespace pietra::pmesh
