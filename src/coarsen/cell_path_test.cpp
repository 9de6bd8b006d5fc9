#include "coarsen/cell_path.h"

#include <gtest/gtest.h>

#include <map>
#include <random>
#include <set>

namespace pietra {
namespace {

Vec3i randomPoint(std::mt19937& random, int limit) {
    std::uniform_int_distribution<int> uniform(0, limit);
    return {uniform(random), uniform(random), uniform(random)};
}

using Wide = __int128;  // six times a cell's volume has up to 64 bits

Wide determinant(const Vec3i& a, const Vec3i& b, const Vec3i& c, const Vec3i& d) {
    const Vec3i u = b - a, v = c - a, w = d - a;
    return Wide(u.x) * (Wide(v.y) * w.z - Wide(v.z) * w.y) -
           Wide(u.y) * (Wide(v.x) * w.z - Wide(v.z) * w.x) +
           Wide(u.z) * (Wide(v.x) * w.y - Wide(v.y) * w.x);
}

TEST(CellPath, cellsHoldTheirPoints) {
    std::mt19937 random(1);
    for (int i = 0; i < 2000; ++i) {
        const Vec3i p = randomPoint(random, 1 << kLatticeBits);
        const CellPath path = cellPath(p, 1, 21);  // coarse enough that determinants fit 64 bits
        for (int level = 0; level <= 21; ++level) {
            const CellId cell = cellAt(path, level);
            ASSERT_EQ(cellLevel(cell), level);
            const auto v = cellCorners(cell);
            const Wide whole = determinant(v[0], v[1], v[2], v[3]);
            ASSERT_TRUE(whole != 0);
            const double w = double(whole);
            EXPECT_GE(double(determinant(p, v[1], v[2], v[3])) / w, 0);
            EXPECT_GE(double(determinant(v[0], p, v[2], v[3])) / w, 0);
            EXPECT_GE(double(determinant(v[0], v[1], p, v[3])) / w, 0);
            EXPECT_GE(double(determinant(v[0], v[1], v[2], p)) / w, 0);
        }
    }
}

TEST(CellPath, manyAtOnceEqualOneByOne) {
    std::mt19937 random(2);
    std::vector<Vec3i> sums(1003);
    for (Vec3i& s : sums) s = randomPoint(random, 3 << kLatticeBits);
    sums[0] = {0, 0, 0};
    sums[1] = Vec3i(3 << kLatticeBits);
    sums[2] = {3 << 20, 3 << 20, 3 << 20};
    std::vector<CellPath> paths(sums.size());
    cellPaths(sums, 3, paths);
    for (size_t i = 0; i < sums.size(); ++i) EXPECT_EQ(paths[i], cellPath(sums[i], 3)) << i;
}

/// Octants from the whole cube down; the corner of a cube has the path of the cube.
TEST(CellPath, cubesHoldTheirPoints) {
    std::mt19937 random(9);
    for (int i = 0; i < 2000; ++i) {
        const Vec3i p = randomPoint(random, (1 << kLatticeBits) - 1);
        const CellPath path = cubePath(p);
        for (int level = 0; level <= kMaxCellLevel; level += 3) {
            const int bits = kLatticeBits - 1 - level / 3;
            const Vec3i corner = p >> bits << bits, end = corner + ((1 << bits) - 1);
            EXPECT_EQ(cellAt(cubePath(corner), level), cellAt(path, level));
            EXPECT_EQ(cellAt(cubePath(end), level), cellAt(path, level));
            EXPECT_EQ(cellLevel(cellAt(path, level)), level);
            if (corner.x > 0) {
                EXPECT_NE(cellAt(cubePath(corner - Vec3i(1, 0, 0)), level), cellAt(path, level));
            }
        }
        const Vec3i q = randomPoint(random, (1 << kLatticeBits) - 1);
        for (int level = 0; level <= kMaxCellLevel; level += 3)
            EXPECT_EQ(cellAt(cubePath(p, q, p), level),
                      std::max(cellAt(path, level), cellAt(cubePath(q), level)));
    }
}

TEST(CellPath, refinementEdgeIsTheLongest) {
    std::mt19937 random(3);
    for (int i = 0; i < 500; ++i) {
        const CellPath path = cellPath(randomPoint(random, 1 << kLatticeBits), 1);
        const int level = i % 50;
        const auto v = cellCorners(cellAt(path, level));
        const auto squared = [&](int a, int b) {
            const glm::i64vec3 d = glm::i64vec3(v[size_t(a)]) - glm::i64vec3(v[size_t(b)]);
            return d.x * d.x + d.y * d.y + d.z * d.z;
        };
        for (int a = 0; a < 4; ++a)
            for (int b = 0; b < a; ++b) EXPECT_LE(squared(a, b), squared(0, 3 - level % 3));
    }
}

TEST(Diamond, cellsShareTheirKeyAndAgreeOnTheirSet) {
    std::mt19937 random(4);
    std::set<size_t> sizes;
    for (int i = 0; i < 500; ++i) {
        const CellPath path = cellPath(randomPoint(random, 1 << kLatticeBits), 1);
        const CellId cell = cellAt(path, i % (kMaxCellLevel + 1));
        const std::vector<CellId> diamond = diamondCells(cell);
        sizes.insert(diamond.size());
        EXPECT_TRUE(std::binary_search(diamond.begin(), diamond.end(), cell));
        for (CellId other : diamond) {
            EXPECT_EQ(diamondKey(other), diamondKey(cell));
            EXPECT_EQ(diamondCells(other), diamond);
        }
    }
    for (size_t size : {4u, 6u, 8u}) EXPECT_TRUE(sizes.count(size)) << size;
    EXPECT_EQ(diamondCells(8).size(), 6u);  // the six roots
}

TEST(Diamond, noOtherCellOfTheLevelHasTheKey) {
    // All cells of level 6, exhaustively.
    std::map<uint64_t, std::set<CellId>> by_key;
    for (CellId root = 8; root < 14; ++root)
        for (CellId k = 0; k < 64; ++k) by_key[diamondKey(root << 6 | k)].insert(root << 6 | k);
    for (const auto& [key, cells] : by_key) {
        const std::vector<CellId> diamond = diamondCells(*cells.begin());
        EXPECT_EQ(std::set<CellId>(diamond.begin(), diamond.end()), cells);
    }
}

TEST(CellId, pathRangesNest) {
    const CellId cell = cellAt(cellPath({5, 77, 1234567}, 1), 30);
    EXPECT_LE(firstPath(cell), cellPath({5, 77, 1234567}, 1));
    EXPECT_GE(lastPath(cell), cellPath({5, 77, 1234567}, 1));
    EXPECT_EQ(firstPath(cellChild(cell, 0)), firstPath(cell));
    EXPECT_EQ(lastPath(cellChild(cell, 1)), lastPath(cell));
    EXPECT_EQ(lastPath(cellChild(cell, 0)) + 1, firstPath(cellChild(cell, 1)));
    EXPECT_TRUE(cellContains(cell, cellChild(cellChild(cell, 1), 0)));
    EXPECT_FALSE(cellContains(cellChild(cell, 1), cell));
}

}  // namespace
}  // namespace pietra
