// Which leaves are closed, against the plain truth: components found over the whole mesh at once.

#include "coarsen/components.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

#include "coarsen/diamond.h"
#include "coarsen/partition_testing.h"

namespace pietra {
namespace {

using ComponentsTest = PartitionTest;

void append(TestMesh& mesh, const TestMesh& other, const Vec3d& shift) {
    const uint64_t base = mesh.positions.size();
    for (const Vec3d& p : other.positions) mesh.positions.push_back(p + shift);
    for (const Index& t : other.triangles)
        mesh.triangles.push_back({base + t[0], base + t[1], base + t[2]});
}

/// A torus of radius 4, bent of n by m squares, or with `open` its upper third taken off.
TestMesh torus(int n, int m, bool open = false) {
    TestMesh mesh;
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < m; ++j) {
            const double a = 2 * M_PI * i / n, b = 2 * M_PI * j / m, r = 4 + std::cos(b);
            mesh.positions.emplace_back(r * std::cos(a), r * std::sin(a), std::sin(b));
        }
    const auto at = [&](int i, int j) { return uint64_t(i % n * m + j % m); };
    for (int i = 0; i < n; ++i)
        for (int j = open ? m / 3 : 0; j < m; ++j) {
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
            mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return mesh;
}

TestMesh sheet(int n, double size) {
    TestMesh mesh;
    for (int i = 0; i <= n; ++i)
        for (int j = 0; j <= n; ++j) mesh.positions.emplace_back(size * i / n, size * j / n, 0);
    const auto at = [&](int i, int j) { return uint64_t(i * (n + 1) + j); };
    for (int i = 0; i < n; ++i)
        for (int j = 0; j < n; ++j) {
            mesh.triangles.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
            mesh.triangles.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    return mesh;
}

TestMesh tetrahedron(double size) {
    return {{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}},
            {{0, 2, 1}, {0, 1, 3}, {1, 2, 3}, {2, 0, 3}}};
}

void flip(Index& triangle) {
    std::swap(triangle[0], triangle[1]);
}

/// Tetrahedra one by one, every fourth with a triangle flipped, every fourth with one missing.
TestMesh dust(int count, unsigned seed) {
    TestMesh mesh;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> place(0, 10);
    for (int i = 0; i < count; ++i) {
        TestMesh grain = tetrahedron(0.1);
        if (i % 4 == 1) flip(grain.triangles[2]);
        if (i % 4 == 2) grain.triangles.pop_back();
        append(mesh, grain, {place(random), place(random), place(random)});
    }
    return mesh;
}

TestMesh insideOut(TestMesh mesh) {
    for (Index& triangle : mesh.triangles) flip(triangle);
    return mesh;
}

/// All in one: closed and not, large and small, touching in a point and along an edge.
TestMesh mixture() {
    TestMesh mesh;
    append(mesh, torus(60, 20), {0, 0, 0});
    append(mesh, torus(60, 20, true), {4, 0, 1});  // runs through the first
    append(mesh, torus(50, 15), {0, 4, -1});
    append(mesh, sheet(25, 12), {-6, -6, 0.4});
    append(mesh, dust(300, 1), {-5, -5, -5});
    TestMesh flipped = torus(30, 10);
    flip(flipped.triangles[77]);
    append(mesh, flipped, {0, 0, 6});
    append(mesh, insideOut(torus(30, 10)), {0, 0, 9});
    append(mesh, insideOut(dust(60, 2)), {-5, -5, 8});
    for (int i = 0; i < 30; ++i) {  // each touches the next in a point: all are closed
        append(mesh, tetrahedron(0.5), {-8 + 0.5 * i, -8, 5});
    }
    for (int i = 0; i < 4; ++i) {  // two tetrahedra along an edge: not closed
        append(mesh, tetrahedron(1), {3.0 * i, 9, 0});
        append(mesh, tetrahedron(-1), {3.0 * i, 9, 0});
        mesh.positions[mesh.positions.size() - 3].x += 2;  // the edge from (0,0,0) to (1,0,0)
    }
    return mesh;
}

using Corners = std::array<uint64_t, 3>;

Corners cornersOf(const Mesh& mesh, size_t t) {
    Corners key;
    for (size_t k = 0; k < 3; ++k) key[k] = latticeKey(mesh.position[mesh.triangle[t][k]]);
    return key;
}

/// For each triangle kept, by its sorted corners: its component is closed, and not inside out.
std::map<Corners, bool> truthOf(const std::vector<Corners>& triangles) {
    struct Use {
        uint32_t triangle;
        bool forward;
    };
    std::map<std::pair<uint64_t, uint64_t>, std::vector<Use>> edges;
    for (uint32_t t = 0; t < triangles.size(); ++t)
        for (size_t k = 0; k < 3; ++k) {
            const uint64_t a = triangles[t][k], b = triangles[t][(k + 1) % 3];
            edges[std::minmax(a, b)].push_back({t, a < b});
        }
    // Plain: labels spread until nothing changes.
    std::vector<uint32_t> label(triangles.size());
    for (uint32_t t = 0; t < label.size(); ++t) label[t] = t;
    for (bool changed = true; changed;) {
        changed = false;
        for (const auto& [edge, uses] : edges)
            for (const Use& use : uses) {
                const uint32_t least = std::min(label[use.triangle], label[uses[0].triangle]);
                changed |= label[use.triangle] != least || label[uses[0].triangle] != least;
                label[use.triangle] = label[uses[0].triangle] = least;
            }
    }
    std::vector<bool> open(triangles.size());
    for (const auto& [edge, uses] : edges)
        if (uses.size() != 2 || uses[0].forward == uses[1].forward)
            open[label[uses[0].triangle]] = true;
    std::vector<double> volume(triangles.size(), 0);
    for (size_t t = 0; t < triangles.size(); ++t) {
        const auto corner = [&](size_t k) { return Vec3d(latticePoint(triangles[t][k])); };
        volume[label[t]] += glm::dot(corner(0), glm::cross(corner(1), corner(2)));
    }
    std::map<Corners, bool> closed;
    for (size_t t = 0; t < triangles.size(); ++t) {
        Corners key = triangles[t];
        std::sort(key.begin(), key.end());
        closed[key] = !open[label[t]] && volume[label[t]] > 0;
    }
    return closed;
}

struct LeafCounts {
    int closed = 0, open = 0;
};

/// Every leaf says what the truth is.
LeafCounts checkLeaves(const PartitionTest::Built& built) {
    std::vector<Corners> all;
    std::vector<std::pair<size_t, CellMesh>> leaves;  // with their first triangle in `all`
    for (const auto& [cell, blob] : built.leaves.blobs) {
        CellMesh& leaf = leaves.emplace_back(all.size(), CellMesh{}).second;
        built.store->get(blob, leaf);
        for (size_t t = 0; t < leaf.mesh.triangleCount(); ++t)
            all.push_back(cornersOf(leaf.mesh, t));
    }
    const std::map<Corners, bool> truth = truthOf(all);
    LeafCounts counts;
    for (const auto& [first, leaf] : leaves) {
        bool closed = true;
        for (size_t t = first; t < first + leaf.mesh.triangleCount(); ++t) {
            Corners key = all[t];
            std::sort(key.begin(), key.end());
            closed &= truth.at(key);
        }
        EXPECT_EQ(leaf.closed, closed);
        ++(closed ? counts.closed : counts.open);
    }
    return counts;
}

TEST_F(ComponentsTest, leavesAreClosedWhereTheTruthIsWhateverTheBuckets) {
    TestMesh mesh = mixture();
    for (const bool shuffled : {false, true}) {
        if (shuffled) std::shuffle(mesh.triangles.begin(), mesh.triangles.end(), std::mt19937(3));
        for (const uint64_t bucket : {20, 60, 400, 100000}) {
            const Built built = build(mesh, bucket, 16, shuffled ? 97 : 1 << 20);
            EXPECT_GT(built.buckets, bucket < 1000 ? 20u : 0u);
            const LeafCounts counts = checkLeaves(built);
            EXPECT_GT(counts.closed, 100);
            EXPECT_GT(counts.open, 100);
        }
    }
}

TEST_F(ComponentsTest, aTorusIsClosedBesideASheet) {
    TestMesh mesh = torus(40, 16);
    append(mesh, sheet(20, 8), {20, 0, 0});
    const Built built = build(mesh, 100, 50);
    int closed = 0, open = 0;
    for (const auto& [cell, blob] : built.leaves.blobs) {
        CellMesh leaf;
        built.store->get(blob, leaf);
        const bool in_torus = built.lattice.toInput(leaf.mesh.position[0]).x < 10;
        EXPECT_EQ(leaf.closed, in_torus);
        ++(in_torus ? closed : open);
    }
    EXPECT_GT(closed, 10);
    EXPECT_GT(open, 10);
}

TEST_F(ComponentsTest, oneTriangleTurnedOverOpensAllOfItsComponent) {
    TestMesh mesh = torus(40, 16);
    for (const uint64_t bucket : {30, 100000})
        EXPECT_EQ(checkLeaves(build(mesh, bucket, 50)).open, 0);
    flip(mesh.triangles[500]);
    for (const uint64_t bucket : {30, 100000})
        EXPECT_EQ(checkLeaves(build(mesh, bucket, 50)).closed, 0);
}

TEST_F(ComponentsTest, whatIsInsideOutIsNotClosed) {
    for (const uint64_t bucket : {30, 100000})
        EXPECT_EQ(checkLeaves(build(insideOut(torus(40, 16)), bucket, 50)).closed, 0);
}

TEST_F(ComponentsTest, aDoubledTriangleCountsOnce) {
    TestMesh mesh = torus(40, 16);
    mesh.triangles.push_back(mesh.triangles[9]);
    flip(mesh.triangles.back());
    EXPECT_EQ(checkLeaves(build(mesh, 30, 50)).open, 0);
}

TEST_F(ComponentsTest, anyNumberOfTrianglesMayShareAnEdge) {
    TestMesh mesh{{{0, 0, -10}, {0, 0, 10}}, {}};
    std::mt19937 random(4);
    std::uniform_real_distribution<double> place(-40, 40);
    for (int i = 0; i < 60000; ++i) {
        mesh.positions.emplace_back(place(random), place(random), place(random));
        mesh.triangles.push_back({0, 1, mesh.positions.size() - 1});
    }
    const Built built = build(mesh, 500, 1000);
    EXPECT_GT(built.buckets, 20u);
    EXPECT_GT(built.leaves.triangles, 40000u);
    for (const auto& [cell, blob] : built.leaves.blobs) {
        CellMesh leaf;
        built.store->get(blob, leaf);
        EXPECT_FALSE(leaf.closed);
    }
}

TEST(LocalComponents, whatIsSettledInTheBucketTakesNoNumber) {
    LocalComponents dust(4000);
    for (uint32_t t = 0; t < 4000; t += 4)
        for (uint32_t k = 1; k < 4; ++k) dust.unite(t, t + k);
    dust.markOpen(2001);
    const BucketComponents found = dust.finish();
    EXPECT_TRUE(found.open.empty());
    EXPECT_TRUE(found.shared_uses.empty());
    ASSERT_EQ(found.runs.size(), 3u);
    EXPECT_EQ(found.runs[1].first, 2000u);
    EXPECT_EQ(found.runs[1].component, kOpenComponent);
    EXPECT_EQ(found.runs[2].first, 2004u);
    EXPECT_EQ(found.runs[2].component, kClosedComponent);
}

/// A ring of `count` bands, each in a bucket of its own, that share an edge with either neighbour.
void addRing(ComponentTable& table, uint64_t first_key, uint32_t count, bool open,
             std::vector<uint32_t>& components) {
    for (uint32_t i = 0; i < count; ++i) {
        LocalComponents band(1);
        const uint64_t left = first_key + 2 * i, right = first_key + 2 * ((i + 1) % count);
        band.share(0, left, left + 1, true);
        band.share(0, right, right + 1, false);
        if (open && i == count / 2) band.markOpen(0);
        BucketComponents found = band.finish();
        table.add(found);
        components.push_back(found.runs[0].component);
    }
}

TEST(ComponentTable, joinsWhatBucketsShareInMemoryAndBeyond) {
    for (const uint32_t length : {3u, 20000u}) {
        Budget budget(4 << 20);
        TempSpace space{testing::TempDir(), &budget, 0};
        ComponentTable table(space, 1 << 20);
        std::vector<uint32_t> closed, open;
        addRing(table, 0, length, false, closed);
        addRing(table, 1'000'000, length, true, open);
        table.resolve();
        EXPECT_EQ(space.peak_bytes > 0, length > 1000);
        EXPECT_EQ(budget.used(), 0u);
        for (const uint32_t c : closed) EXPECT_TRUE(table.isClosed(c));
        for (const uint32_t c : open) EXPECT_FALSE(table.isClosed(c));
        EXPECT_TRUE(table.isClosed(kClosedComponent));
        EXPECT_FALSE(table.isClosed(kOpenComponent));
    }
}

/// Struts along the edges of a grid of n by n by n: closed, with some 3 n^3 handles, which no edge
/// collapse takes away. Its lowest corner lies at x = y = z = `low`.
CellMesh sponge(int n, int low) {
    const auto isFilled = [&](const Vec3i& v) {
        for (int k = 0; k < 3; ++k)
            if (v[k] < 0 || v[k] > 2 * n) return false;
        return (v.x & 1) + (v.y & 1) + (v.z & 1) < 2;
    };
    CellMesh cell;
    std::map<uint64_t, uint32_t> index;
    const auto vertex = [&](const Vec3i& v) {
        const Vec3i p = v * 1000 + low;
        const auto [at, is_new] =
            index.try_emplace(latticeKey(p), uint32_t(cell.mesh.position.size()));
        if (is_new) cell.mesh.position.push_back(p);
        return at->second;
    };
    for (int z = 0; z <= 2 * n; ++z)
        for (int y = 0; y <= 2 * n; ++y)
            for (int x = 0; x <= 2 * n; ++x)
                for (int face = 0; face < 6 && isFilled({x, y, z}); ++face) {
                    const int axis = face / 2, side = face & 1;
                    Vec3i step(0), u(0), v(0);
                    step[axis] = side ? 1 : -1;
                    if (isFilled(Vec3i(x, y, z) + step)) continue;
                    u[(axis + (side ? 1 : 2)) % 3] = v[(axis + (side ? 2 : 1)) % 3] = 1;
                    const Vec3i corner = Vec3i(x, y, z) + (side ? step : Vec3i(0));
                    const uint32_t a = vertex(corner), b = vertex(corner + u),
                                   c = vertex(corner + u + v), d = vertex(corner + v);
                    cell.mesh.triangle.push_back({a, b, c});
                    cell.mesh.triangle.push_back({a, c, d});
                }
    cell.mesh.normal.resize(cell.mesh.position.size());
    cell.mesh.edge_class.assign(cell.mesh.triangle.size(), 0);
    cell.bounds.to_original.assign(cell.mesh.triangle.size(), 0.5f);
    cell.bounds.from_original = cell.bounds.to_original;
    cell.closed = true;
    return cell;
}

TEST_F(ComponentsTest, coarserCellsAreClosedUnlessOpenOrClustered) {
    CellStore store(space_, 0);
    const CellMesh closed = sponge(5, 1000);  // the largest: never dropped as a whole
    CellMesh open = sponge(4, 100000);
    open.closed = false;
    const uint32_t count = uint32_t(closed.mesh.triangleCount());
    DiamondInput input;
    input.children = {{store.put(closed)}, {store.put(open)}, {store.put(sponge(3, 200000))}};
    DiamondWorker worker(0, {});
    for (const bool cluster : {false, true}) {
        input.quota = {cluster ? 50 : count - 10, count - 10, count};
        DiamondOutput output;
        worker.run(input, output);
        EXPECT_EQ(output.clustered > 0, cluster);
        EXPECT_EQ(output.cells[0].closed, !cluster);
        EXPECT_FALSE(output.cells[1].closed);
        EXPECT_EQ(output.cells[2].closed, !cluster);
        CellMesh again;
        store.get(store.put(output.cells[2]), again);
        EXPECT_EQ(again.closed, !cluster);
    }
}

}  // namespace
}  // namespace pietra
