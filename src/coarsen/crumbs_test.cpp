// Crumbs against the plain truth: nothing is lost, and what has a larger neighbour goes there.

#include "coarsen/crumbs.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "coarsen/edge_spread.h"
#include "coarsen/partition_testing.h"

namespace pietra {
namespace {

using Key = std::array<uint64_t, 3>;
using Content = std::map<CellId, std::set<Key>>;

class CrumbsTest : public PartitionTest {
public:
    Content contentOf(const Built& built) {
        Content content;
        for (const auto& [cell, blob] : built.leaves.blobs) {
            CellMesh leaf;
            built.store->get(blob, leaf);
            EXPECT_EQ(leaf.bounds.to_original, std::vector<float>(leaf.mesh.triangleCount(), 0.5f));
            EXPECT_EQ(leaf.mesh.edge_class.size(), leaf.mesh.triangleCount());
            for (const Triangle& t : leaf.mesh.triangle) {
                Key key;
                for (size_t k = 0; k < 3; ++k) key[k] = latticeKey(leaf.mesh.position[t[k]]);
                EXPECT_TRUE(content[cell].insert(key).second);
            }
        }
        return content;
    }
};

std::set<Key> trianglesOf(const Content& content) {
    std::set<Key> all;
    for (const auto& [cell, keys] : content)
        for (const Key& key : keys) EXPECT_TRUE(all.insert(key).second);
    return all;
}

/// A fine grid at z = 0, and beside it fans of long triangles whose barycentres are far away.
TestMesh gridWithFans(uint64_t n) {
    TestMesh mesh;
    for (uint64_t y = 0; y <= n; ++y)
        for (uint64_t x = 0; x <= n; ++x) mesh.positions.emplace_back(x, y, 0.01 * double(x * y));
    for (uint64_t y = 0; y < n; ++y)
        for (uint64_t x = 0; x < n; ++x) {
            const uint64_t a = y * (n + 1) + x;
            mesh.triangles.push_back({a, a + 1, a + n + 1});
            mesh.triangles.push_back({a + 1, a + n + 2, a + n + 1});
        }
    for (uint64_t x = 0; x < n; ++x) {
        if (x % 7 == 0) mesh.positions.emplace_back(x, -double(n), 3.0 * double(x));
        mesh.triangles.push_back({x + 1, x, mesh.positions.size() - 1});
    }
    return mesh;
}

TEST_F(CrumbsTest, goToTheirNeighboursWhateverTheBuckets) {
    const TestMesh mesh = gridWithFans(60);
    Content first;
    for (const uint64_t bucket : {200, 1 << 19}) {
        Built built = build(mesh, bucket, 200);
        const Content before = contentOf(built);
        moveCrumbs(built.leaves, *built.store, 40, progress_);
        const Content after = contentOf(built);
        EXPECT_EQ(trianglesOf(after), trianglesOf(before));
        EXPECT_LT(after.size(), before.size());
        // All hangs together: leaves go as a whole or grow.
        size_t small = 0;
        for (const auto& [cell, keys] : before) small += keys.size() < 10;
        EXPECT_GT(small, 5u);
        for (const auto& [cell, keys] : after) {
            ASSERT_TRUE(before.count(cell));
            EXPECT_GE(keys.size(), before.at(cell).size());
        }
        if (first.empty()) first = after;
        EXPECT_EQ(after, first);
    }
}

TEST_F(CrumbsTest, stayWhereThereIsNothingElse) {
    TestMesh mesh;
    for (uint64_t i = 0; i < 200; ++i) {
        const double x = double(i * 37 % 101), y = double(i * 53 % 89), z = double(i * 17 % 97);
        for (int k = 0; k < 3; ++k)
            mesh.positions.emplace_back(x + 0.1 * (k == 1), y + 0.1 * (k == 2), z);
        mesh.triangles.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    Built built = build(mesh, 1 << 19, 10);
    const Content before = contentOf(built);
    moveCrumbs(built.leaves, *built.store, 8, progress_);
    EXPECT_EQ(contentOf(built), before);
}

TEST(EdgeSpread, theLeastOfTheNearestOwnersWins) {
    EdgeSpread spread;
    spread.clear();
    for (uint32_t i = 0; i < 10; ++i) spread.add({i, i + 1, i + 2});  // a strip
    spread.add({50, 51, 52});
    spread.claim(1, 0, 7);
    spread.claim(0, 1, 9);
    spread.claim(10, 11, 3);
    spread.claim(77, 78, 1);
    spread.run();
    for (size_t i = 0; i < 5; ++i) EXPECT_EQ(spread.owner(i), 7u);
    for (size_t i = 5; i < 10; ++i) EXPECT_EQ(spread.owner(i), 3u);
    EXPECT_EQ(spread.owner(10), EdgeSpread::kNobody);
}

}  // namespace
}  // namespace pietra
