// The partition against the plain truth: whatever the buckets, edges and normals come out as if the
// whole mesh had been looked at at once.

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>
#include <set>

#include "coarsen/partition_testing.h"

namespace pietra {
namespace {

/// A wavy grid with a hole, a third sheet on some edges, a duplicate, a degenerate triangle.
TestMesh awkwardMesh(int n, bool shuffled) {
    TestMesh mesh;
    std::mt19937 random(7);
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x)
            mesh.positions.emplace_back(x, y, 3 * ((x * 7 + y * 13) % 5) / 5.0 + 0.05 * x * y / n);
    const auto at = [&](int x, int y) { return uint64_t(y * (n + 1) + x); };
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            if (x > n / 3 && x < n / 2 && y > n / 3 && y < n / 2) continue;
            mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x, y + 1)});
            mesh.triangles.push_back({at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)});
        }
    for (int x = 0; x + 1 < n; x += 3) {  // fins along the diagonal, with long triangles
        mesh.positions.emplace_back(x + 0.5, x + 0.5, 8.0 + x);
        mesh.triangles.push_back({at(x + 1, x), at(x, x + 1), mesh.positions.size() - 1});
    }
    mesh.triangles.push_back({mesh.triangles[5][1], mesh.triangles[5][0], mesh.triangles[5][2]});
    mesh.triangles.push_back({0, 0, 1});
    if (shuffled) std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), random);
    return mesh;
}

using Edge = std::pair<uint64_t, uint64_t>;

struct Truth {
    std::map<Edge, int> uses;
    std::map<uint64_t, Vec3l> normal_sum;
    std::set<std::array<uint64_t, 3>> triangles;
};

Truth truthOf(const TestMesh& mesh, const Lattice& lattice) {
    Truth truth;
    for (const Index& t : mesh.triangles) {
        std::array<uint64_t, 3> key;
        std::array<Vec3i, 3> p;
        for (size_t k = 0; k < 3; ++k) {
            p[k] = lattice.snap(mesh.positions[t[k]]);
            key[k] = latticeKey(p[k]);
        }
        auto sorted = key;
        std::sort(sorted.begin(), sorted.end());
        if (sorted[0] == sorted[1] || sorted[1] == sorted[2]) continue;
        if (!truth.triangles.insert(sorted).second) continue;
        const Vec3l n = crossInteger(p[1] - p[0], p[2] - p[0]);
        for (size_t k = 0; k < 3; ++k) {
            ++truth.uses[std::minmax(key[k], key[(k + 1) % 3])];
            truth.normal_sum.try_emplace(key[k], Vec3l(0)).first->second += n;
        }
    }
    return truth;
}

TEST_F(PartitionTest, leavesHoldTheWholeTruthWhateverTheBuckets) {
    for (const auto& [shuffled, shape] : std::initializer_list<std::pair<bool, CellShape>>{
             {false, CellShape::kTetrahedra},
             {true, CellShape::kTetrahedra},
             {false, CellShape::kCubes},
             {true, CellShape::kCubes}})
        for (const uint64_t bucket : {40, 300, 100000}) {
            const TestMesh mesh = awkwardMesh(40, shuffled);
            const Built built = build(mesh, bucket, 50, shuffled ? 97 : 1 << 20, shape);
            EXPECT_GT(built.buckets, bucket < 1000 ? 10u : 0u);
            const Truth truth = truthOf(mesh, built.lattice);
            EXPECT_EQ(built.degenerate, 1u);
            EXPECT_EQ(built.leaves.duplicates, 1u);
            std::set<std::array<uint64_t, 3>> found;
            uint64_t border = 0, many = 0;
            for (const auto& [cell, blob] : built.leaves.blobs) {
                EXPECT_TRUE(shape == CellShape::kTetrahedra || cellLevel(cell) % 3 == 0);
                CellMesh leaf;
                built.store->get(blob, leaf);
                EXPECT_LE(leaf.mesh.triangleCount(), 50u);
                for (size_t t = 0; t < leaf.mesh.triangleCount(); ++t) {
                    EXPECT_TRUE(cellContains(
                        cell, cellAt(trianglePath(leaf.mesh, t, shape), kMaxCellLevel)));
                    std::array<uint64_t, 3> key;
                    for (size_t k = 0; k < 3; ++k)
                        key[k] = latticeKey(leaf.mesh.position[leaf.mesh.triangle[t][k]]);
                    for (int k = 0; k < 3; ++k) {
                        const int uses =
                            truth.uses.at(std::minmax(key[size_t(k)], key[size_t((k + 1) % 3)]));
                        const EdgeClass expected = uses == 1   ? EdgeClass::kBorder
                                                   : uses == 2 ? EdgeClass::kManifold
                                                   : uses == 3 ? EdgeClass::kTriple
                                                               : EdgeClass::kMany;
                        EXPECT_EQ(leaf.mesh.edgeClass(t, k), expected);
                        border += uses == 1;
                        many += uses > 2;
                    }
                    for (size_t k = 0; k < 3; ++k) {
                        const Vec3f n = decodeNormal(leaf.mesh.normal[leaf.mesh.triangle[t][k]]);
                        const Vec3d sum(truth.normal_sum.at(key[k]));
                        EXPECT_GT(glm::dot(Vec3d(n), glm::normalize(sum)), 0.99999);
                    }
                    std::sort(key.begin(), key.end());
                    EXPECT_TRUE(found.insert(key).second);
                }
            }
            EXPECT_EQ(found, truth.triangles);
            EXPECT_GT(border, 100u);
            EXPECT_GT(many, 10u);
            EXPECT_EQ(built.leaves.edges.border, border);
        }
}

TEST_F(PartitionTest, aMillionCopiesOfOneTriangleAreOneTriangle) {
    TestMesh mesh{{{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {}};
    mesh.triangles.assign(1'000'000, {0, 1, 2});
    const Built built = build(mesh, 1000, 50);
    EXPECT_EQ(built.leaves.triangles, 1u);
    EXPECT_EQ(built.leaves.duplicates, 999'999u);
    EXPECT_EQ(built.leaves.edges.border, 3u);
}

TEST_F(PartitionTest, precisionFollowsTheMedianEdgeButSparesSmallTriangles) {
    // A grid of unit edges over 400 units: 1/50 of an edge is about 100 lattice units.
    TestMesh mesh;
    for (int y = 0; y <= 400; ++y)
        for (int x = 0; x <= 400; ++x) mesh.positions.emplace_back(x, y, 0);
    for (uint64_t y = 0; y < 400; ++y)
        for (uint64_t x = 0; x < 400; ++x) {
            mesh.triangles.push_back({y * 401 + x, y * 401 + x + 1, y * 401 + x + 401});
            mesh.triangles.push_back({y * 401 + x + 1, y * 401 + x + 402, y * 401 + x + 401});
        }
    const Built coarse = build(mesh, 1 << 19, 4000);
    const double edge = 1 / coarse.lattice.step;
    const double error = std::sqrt(3.0) * (0.5 + (1 << coarse.lattice.shift) / 2.0);
    EXPECT_LE(error, edge * 1.42 / 50);
    EXPECT_GT(error * 2, edge / 50 * 0.9);
    // One triangle with an edge of 1/500: it must not collapse.
    mesh.positions.emplace_back(0.001, 0.001, 5);
    mesh.positions.emplace_back(0.003, 0.001, 5);
    mesh.triangles.push_back({0, mesh.positions.size() - 2, mesh.positions.size() - 1});
    const Built fine = build(mesh, 1 << 19, 4000);
    EXPECT_LT(fine.lattice.shift, coarse.lattice.shift);
    EXPECT_EQ(fine.degenerate, 0u);
}

TEST(CellTree, diamondsAreSplitAsAWhole) {
    std::mt19937 random(11);
    size_t forced = 0;
    for (int round = 0; round < 20; ++round) {
        // Points crowded around a centre: leaves of very different depth side by side.
        std::normal_distribution<double> normal(0, round % 2 ? 3000 : 200000);
        const int centre = 1 << 20;
        std::vector<CellPath> paths(3000);
        for (CellPath& path : paths) {
            Vec3i p;
            for (int k = 0; k < 3; ++k)
                p[k] = std::clamp(centre / 3 * (k + 1) + int(normal(random)), 0, kLatticeMax);
            path = cellPath(p, 1);
        }
        std::sort(paths.begin(), paths.end());
        std::vector<LeafCell> leaves;
        const auto cut = [&](auto&& self, size_t begin, size_t end, int level) -> void {
            if (begin == end) return;
            if (end - begin > 20) {
                const CellPath middle = firstPath(cellChild(cellAt(paths[begin], level), 1));
                const size_t split =
                    size_t(std::lower_bound(paths.begin() + ptrdiff_t(begin),
                                            paths.begin() + ptrdiff_t(end), middle) -
                           paths.begin());
                self(self, begin, split, level + 1);
                self(self, split, end, level + 1);
                return;
            }
            uint64_t occupied = 0;
            for (size_t i = begin; i < end; ++i)
                occupied |= uint64_t(1) << (paths[i] >> (55 - level) & 63);
            leaves.push_back({cellAt(paths[begin], level), uint32_t(end - begin), occupied});
        };
        for (CellId root = 8; root < 14; ++root) {
            const auto begin = std::lower_bound(paths.begin(), paths.end(), firstPath(root));
            const auto end = std::upper_bound(paths.begin(), paths.end(), lastPath(root));
            cut(cut, size_t(begin - paths.begin()), size_t(end - paths.begin()), 0);
        }
        const CellTree tree(leaves, 20);
        // Each path has exactly one leaf, and it is not larger than allowed.
        std::map<CellId, int> count;
        for (CellPath path : paths) {
            int covers = 0;
            for (int level = 0; level <= tree.deepestLevel(); ++level)
                if (std::find(tree.leaves().begin(), tree.leaves().end(), cellAt(path, level)) !=
                    tree.leaves().end()) {
                    ++covers;
                    ++count[cellAt(path, level)];
                }
            ASSERT_EQ(covers, 1);
        }
        for (const auto& [cell, n] : count) EXPECT_LE(n, 20);
        // Every cell of a split diamond that holds a path is split.
        size_t checked = 0;
        for (int level = 0; level < tree.deepestLevel(); ++level) {
            const std::vector<CellId>& split = tree.splitCells(level);
            for (CellId cell : split)
                for (CellId member : diamondCells(cell)) {
                    const auto first =
                        std::lower_bound(paths.begin(), paths.end(), firstPath(member));
                    if (first == paths.end() || *first > lastPath(member)) continue;
                    ++checked;
                    EXPECT_TRUE(std::binary_search(split.begin(), split.end(), member));
                }
        }
        EXPECT_GT(checked, 50u);
        forced += tree.forcedSplits();
    }
    EXPECT_GT(forced, 0u);
}

}  // namespace
}  // namespace pietra
