#pragma once
// Cells of the conformal hierarchy of tetrahedra (Cignoni et al. 2004, section 3): the cube
// [0, 2^21]^3 is cut into the six tetrahedra around its main diagonal, and each cell is bisected at
// the midpoint of its longest edge. A cell is named by its path: the root and one bit a level; the
// order of paths is a space-filling curve, and sorting triangles by the path of their barycentre is
// the partition. All predicates are exact in integers; points on a cell's face go to the second
// child, so each point has exactly one path.
//
// Cubes (Wu and Huang 2014, section 5.1) are named likewise, by the octants along the way down:
// three bits an octree level, the first of which are the root's, so that levels of cells that are
// cubes are multiples of three; a triangle belongs to the last of the cells of its corners.
//
// All cells of one level that share their refinement edge form a diamond; its key is the midpoint
// of that edge. Pure functions, thread-safe.

#include <algorithm>
#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/lattice.h"
#include "geometry/morton.h"

namespace pietra {

enum class CellShape : uint8_t { kTetrahedra, kCubes };

/// Deepest level of a cell; beyond it, the midpoints of edges would need more than 21 bits.
inline constexpr int kMaxCellLevel = 57;

/// A full path: root in the top three bits, then kMaxCellLevel bits, then zeros. Comparable.
using CellPath = uint64_t;

/// A cell: its path's leading bits behind a one, like an index into a binary heap: roots are 8..13,
/// of cubes 8..15, the children of c are 2c and 2c+1.
using CellId = uint64_t;

inline int cellLevel(CellId cell) {
    return 60 - std::countl_zero(cell);
}
inline CellId cellParent(CellId cell) {
    return cell >> 1;
}
inline CellId cellChild(CellId cell, int bit) {
    return cell << 1 | uint64_t(bit);
}
/// The cell at `level` that holds every point of this path.
inline CellId cellAt(CellPath path, int level) {
    return uint64_t(1) << (3 + level) | path >> (61 - level);
}
/// Smallest path in the cell.
inline CellPath firstPath(CellId cell) {
    const int level = cellLevel(cell);
    return (cell ^ uint64_t(1) << (3 + level)) << (61 - level);
}
/// Largest path in the cell.
inline CellPath lastPath(CellId cell) {
    return firstPath(cell) | ((uint64_t(1) << (61 - cellLevel(cell))) - 1);
}
/// `inner` is `outer` or lies in it.
inline bool cellContains(CellId outer, CellId inner) {
    const int deeper = cellLevel(inner) - cellLevel(outer);
    return deeper >= 0 && inner >> deeper == outer;
}

/// Path of the point p / scale, down to `level`; 0 <= p <= scale * 2^21 in each coordinate, scale a
/// small number (3 for a barycentre given as the sum of three corners).
CellPath cellPath(const Vec3i& p, int scale, int level = kMaxCellLevel);

/// Paths of many points p / scale, to `level` rounded up to a multiple of three.
void cellPaths(std::span<const Vec3i> points, int scale, std::span<CellPath> paths,
               int level = kMaxCellLevel);

/// Of the cubes that hold the point of this Morton code. Its lowest three bits get lost.
inline CellPath cubePathOf(uint64_t code) {
    return code >> 3 << 4;
}
inline CellPath cubePath(const Vec3i& p) {
    return cubePathOf(mortonCode(p));
}
inline CellPath cubePath(const Vec3i& a, const Vec3i& b, const Vec3i& c) {
    return std::max({cubePath(a), cubePath(b), cubePath(c)});
}
/// The path of a triangle in a partition by either.
inline CellPath trianglePath(CellShape shape, const Vec3i& a, const Vec3i& b, const Vec3i& c) {
    return shape == CellShape::kCubes ? cubePath(a, b, c) : cellPath(a + b + c, 3);
}

/// The four corners, in the order that the bisection rule keeps.
std::array<Vec3i, 4> cellCorners(CellId cell);

/// Key of the diamond that the cell belongs to: its refinement edge's midpoint. Unique in a level.
uint64_t diamondKey(CellId cell);

/// All cells of the cell's diamond, itself included, in path order (at most eight; fewer at the
/// surface of the cube).
std::vector<CellId> diamondCells(CellId cell);

}  // namespace pietra
