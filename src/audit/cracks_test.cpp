#include "audit/cracks.h"

#include <gtest/gtest.h>

#include <bit>
#include <map>
#include <mutex>
#include <set>

#include "audit/audit_testing.h"
#include "base/error.h"
#include "base/hash.h"
#include "multires/cut.h"
#include "multires/toy_terrain.h"

namespace pietra {
namespace {

CrackReport countAll(const std::vector<Mesh>& patches, size_t memory_bytes = 8 << 20) {
    Budget budget(64 << 20);
    std::vector<NodeIndex> all(patches.size());
    for (NodeIndex i = 0; i < all.size(); ++i) all[i] = i;
    return countCracks(streamOf(patches), all, budget, memory_bytes, tempDir());
}

std::vector<Mesh> patchesOf(const ToyTerrain& model, const Cut& cut) {
    std::vector<Mesh> patches;
    for (const NodeIndex i : cut.nodes) patches.push_back(model.patches[i]);
    return patches;
}

/// What the header promises, by one map over all edges.
CrackReport bruteForce(const std::vector<Mesh>& patches) {
    std::map<EdgeKey, std::vector<EdgeClass>> edges;
    CrackReport report;
    for (const Mesh& mesh : patches)
        for (size_t t = 0; t < mesh.triangleCount(); ++t) {
            std::array<uint64_t, 3> p;
            for (int k = 0; k < 3; ++k) p[k] = latticeKey(mesh.position[mesh.triangle[t][k]]);
            ++report.triangles;
            if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) {
                ++report.degenerate_triangles;
                continue;
            }
            for (int k = 0; k < 3; ++k)
                edges[{std::min(p[k], p[(k + 1) % 3]), std::max(p[k], p[(k + 1) % 3])}].push_back(
                    mesh.edgeClass(t, k));
        }
    report.edges = edges.size();
    for (const auto& [key, uses] : edges) {
        const std::set<EdgeClass> classes(uses.begin(), uses.end());
        const bool multiple = classes.count(EdgeClass::kTriple) || classes.count(EdgeClass::kMany);
        const size_t n = uses.size();
        bool fault = classes.size() > 1;
        report.disagreeing_edges += fault;
        if (n == 1 && uses[0] == EdgeClass::kBorder)
            ++report.border_edges;
        else if (n == 1)
            ++report.cracked_edges, fault = true;
        else if (n > 2 && !multiple)
            ++report.overlapping_edges, fault = true;
        else if (classes.size() == 1) {
            const EdgeClass c = uses[0];
            const bool right = (c == EdgeClass::kManifold && n == 2) ||
                               (c == EdgeClass::kTriple && n == 3) ||
                               (c == EdgeClass::kMany && n >= 4);
            if (!right) ++report.miscounted_edges, fault = true;
        }
        if (fault && !report.first_fault) report.first_fault = key;
    }
    return report;
}

void expectEqual(const CrackReport& a, const CrackReport& b) {
    EXPECT_EQ(a.triangles, b.triangles);
    EXPECT_EQ(a.edges, b.edges);
    EXPECT_EQ(a.border_edges, b.border_edges);
    EXPECT_EQ(a.cracked_edges, b.cracked_edges);
    EXPECT_EQ(a.overlapping_edges, b.overlapping_edges);
    EXPECT_EQ(a.miscounted_edges, b.miscounted_edges);
    EXPECT_EQ(a.disagreeing_edges, b.disagreeing_edges);
    EXPECT_EQ(a.degenerate_triangles, b.degenerate_triangles);
    EXPECT_EQ(a.first_fault, b.first_fault);
    EXPECT_TRUE(a.exact);
}

Mesh meshOf(std::vector<Vec3i> positions, std::vector<Triangle> triangles,
            EdgeClass edge_class = EdgeClass::kManifold) {
    Mesh mesh;
    mesh.position = std::move(positions);
    mesh.triangle = std::move(triangles);
    mesh.edge_class.assign(mesh.triangle.size(), uint8_t(unsigned(edge_class) * 0b010101));
    return mesh;
}

Mesh tetrahedron(const Vec3i& corner, int32_t size = 4) {
    return meshOf({corner, corner + Vec3i(size, 0, 0), corner + Vec3i(0, size, 0),
                   corner + Vec3i(0, 0, size)},
                  {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}});
}

/// An n by n grid whose patch is closed off by nothing: its rim is cracked.
Mesh sheet(int n) {
    std::vector<Vec3i> positions;
    std::vector<Triangle> triangles;
    const auto at = [&](int x, int y) { return uint32_t(y * (n + 1) + x); };
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x) positions.push_back({x, y, 0});
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
            triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
        }
    return meshOf(positions, triangles);
}

void dropTriangle(Mesh& mesh, size_t t) {
    mesh.triangle.erase(mesh.triangle.begin() + ptrdiff_t(t));
    mesh.edge_class.erase(mesh.edge_class.begin() + ptrdiff_t(t));
}

Mesh onlyTriangle(const Mesh& mesh, size_t t) {
    Mesh copy = mesh;
    copy.triangle = {mesh.triangle[t]};
    copy.edge_class = {mesh.edge_class[t]};
    return copy;
}

TEST(Cracks, validCutsHaveNoneAndAnyOtherChoiceOfNodesIsCountedExactly) {
    const ToyTerrain model = makeToyTerrain();
    for (uint64_t seed = 0; seed < 12; ++seed) {
        const Cut cut = randomCut(model.nodes, seed);
        const CrackReport report = countAll(patchesOf(model, cut));
        EXPECT_TRUE(report.ok());
        EXPECT_EQ(report.triangles, cut.triangles);
        expectEqual(report, bruteForce(patchesOf(model, cut)));
        // Any nodes at all: holes, overlaps, T-vertices.
        std::vector<Mesh> some;
        for (NodeIndex i = 0; i < model.nodes.size(); ++i)
            if (mixBits(seed * 9973 + i) % 3 == 0) some.push_back(model.patches[i]);
        const CrackReport faulty = countAll(some);
        EXPECT_GT(faulty.cracked_edges, 10u);
        expectEqual(faulty, bruteForce(some));
    }
}

TEST(Cracks, parentDrawnBesideItsChildrenOverlaps) {
    const ToyTerrain model = makeToyTerrain();
    std::vector<Mesh> patches = patchesOf(model, finestCut(model.nodes));
    patches.push_back(model.patches[0]);
    const CrackReport report = countAll(patches);
    EXPECT_FALSE(report.ok());
    expectEqual(report, bruteForce(patches));
}

TEST(Cracks, aMissingTriangleLeavesThreeCrackedEdges) {
    const ToyTerrain model = makeToyTerrain();
    std::vector<Mesh> patches = patchesOf(model, finestCut(model.nodes));
    for (size_t patch = 0; patch < patches.size(); patch += patches.size() / 8) {
        const Mesh whole = patches[patch];
        for (size_t t = 0; t < whole.triangleCount(); ++t) {
            dropTriangle(patches[patch], t);
            const CrackReport report = countAll(patches);
            uint64_t interior = 0;
            for (int k = 0; k < 3; ++k) interior += whole.edgeClass(t, k) == EdgeClass::kManifold;
            EXPECT_EQ(report.cracked_edges, interior);
            EXPECT_EQ(report.overlapping_edges, 0u);
            EXPECT_FALSE(report.ok());
            patches[patch] = whole;
        }
    }
}

TEST(Cracks, aDoubledTriangleOverlapsWhereverItLies) {
    // In the middle of a sheet all edges are complete within the patch.
    Mesh mesh = sheet(10);
    const size_t middle = 2 * (5 * 10 + 5);
    const uint64_t rim = countAll({mesh}).cracked_edges;
    EXPECT_EQ(rim, 40u);
    const CrackReport apart = countAll({mesh, onlyTriangle(mesh, middle)});
    EXPECT_EQ(apart.cracked_edges, rim);
    EXPECT_EQ(apart.overlapping_edges, 3u);
    expectEqual(apart, bruteForce({mesh, onlyTriangle(mesh, middle)}));
    mesh.triangle.push_back(mesh.triangle[middle]);
    mesh.edge_class.push_back(mesh.edge_class[middle]);
    EXPECT_EQ(countAll({mesh}).overlapping_edges, 3u);
}

TEST(Cracks, aDoubledPatchIsFoundThoughEachIsComplete) {
    const std::vector<Mesh> once = {tetrahedron({10, 10, 10})};
    EXPECT_TRUE(countAll(once).ok());
    const CrackReport twice = countAll({once[0], once[0]});
    EXPECT_EQ(twice.overlapping_edges, 6u);
    EXPECT_EQ(twice.edges, 6u);
    // One round over the patches knows that it does not know.
    Budget budget(64 << 20);
    CrackCounter counter(budget, 4 << 20, tempDir());
    counter.add(once[0]);
    counter.add(once[0]);
    const CrackReport first = counter.finish();
    EXPECT_FALSE(first.exact);
    EXPECT_FALSE(first.ok());
    EXPECT_EQ(counter.sharedVertices().keys.size(), 4u);
}

TEST(Cracks, componentsThatTouchInAPointAreFine) {
    const CrackReport report =
        countAll({tetrahedron({0, 0, 0}), tetrahedron({4, 0, 0}), tetrahedron({0, 4, 0})});
    EXPECT_TRUE(report.ok());
    EXPECT_EQ(report.edges, 18u);
}

TEST(Cracks, moreSharedVerticesThanFitAreCountedToo) {
    // 2 MiB hold a list of 16384 shared vertices; here all 40,000 and more are.
    const Mesh mesh = sheet(220);
    const CrackReport report = countAll({mesh, mesh}, 2 << 20);
    expectEqual(report, bruteForce({mesh, mesh}));
    EXPECT_EQ(report.overlapping_edges, report.edges - 4 * 220);
}

TEST(Cracks, spillsToDiskAndCountsTheSame) {
    ToyTerrainSettings settings;
    settings.depth = 13;
    settings.keep_refining = 0.97;
    const ToyTerrain model = makeToyTerrain(settings);
    std::vector<Mesh> patches = patchesOf(model, finestCut(model.nodes));
    ASSERT_GT(patches.size(), 10000u);
    dropTriangle(patches[patches.size() / 2], 0);
    patches.push_back(patches[7]);
    const CrackReport expected = bruteForce(patches);
    expectEqual(countAll(patches, 2 << 20), expected);
    expectEqual(countAll(patches, 48 << 20), expected);
    EXPECT_GT(expected.cracked_edges + expected.overlapping_edges, 3u);
    Budget budget(3 << 20);
    CrackCounter counter(budget, 2 << 20, tempDir());
    EXPECT_LE(budget.peak(), 2u << 20);
    EXPECT_THROW(CrackCounter(budget, 2 << 20, tempDir()), MemoryError);
}

TEST(Cracks, edgeClassesSayHowManyUsesAreRight) {
    const std::vector<Vec3i> p = {{9, 9, 9}, {18, 9, 9}, {9, 18, 9},
                                  {9, 0, 9}, {9, 9, 18}, {9, 9, 0}};
    const std::vector<Triangle> fan = {{0, 1, 2}, {1, 0, 3}, {0, 1, 4}, {1, 0, 5}};
    for (size_t uses = 1; uses <= 4; ++uses)
        for (unsigned c = 0; c < 4; ++c) {
            Mesh mesh = meshOf(p, std::vector<Triangle>(fan.begin(), fan.begin() + uses));
            mesh.edge_class.assign(uses, uint8_t(c | unsigned(EdgeClass::kBorder) * 0b010100));
            const CrackReport report = countAll({mesh});
            expectEqual(report, bruteForce({mesh}));
            const size_t right[] = {2, 1, 3, 4};
            EXPECT_EQ(report.ok(), uses == right[c]) << uses << " uses, class " << c;
        }
    // Neighbours that disagree, in one patch and across two.
    Mesh one = meshOf(p, {fan[0]}, EdgeClass::kBorder),
         two = meshOf(p, {fan[1]}, EdgeClass::kBorder);
    one.edge_class[0] = 0b010100;
    EXPECT_EQ(countAll({one, two}).disagreeing_edges, 1u);
    one.triangle.push_back(two.triangle[0]);
    one.edge_class.push_back(two.edge_class[0]);
    EXPECT_EQ(countAll({one}).disagreeing_edges, 1u);
}

TEST(Cracks, degenerateTrianglesAreFaultsOfTheirOwn) {
    Mesh mesh = tetrahedron({0, 0, 0});
    mesh.triangle.push_back({0, 1, 1});
    mesh.edge_class.push_back(0);
    mesh.position.push_back({4, 0, 0});  // corner 1 again, with other attributes
    mesh.triangle.push_back({1, 4, 2});
    mesh.edge_class.push_back(0);
    const CrackReport report = countAll({mesh});
    EXPECT_EQ(report.degenerate_triangles, 2u);
    EXPECT_EQ(report.cracked_edges + report.overlapping_edges, 0u);
    EXPECT_FALSE(report.ok());
}

TEST(Cracks, seamsOfAttributesAreNoCracks) {
    Mesh mesh = tetrahedron({0, 0, 0});
    for (uint32_t k = 0; k < 3; ++k) {
        mesh.position.push_back(mesh.position[mesh.triangle[3][k]]);
        mesh.triangle[3][k] = 4 + k;
    }
    EXPECT_TRUE(countAll({mesh}).ok());
    EXPECT_TRUE(countAll({Mesh{}}).ok());
    EXPECT_TRUE(countAll({}).ok());
}

TEST(Cracks, bordersAreReported) {
    const ToyTerrain model = makeToyTerrain();
    const Cut cut = finestCut(model.nodes);
    Budget budget(64 << 20);
    std::mutex mutex;
    std::set<EdgeKey> borders;
    const CrackReport report = countCracks(streamOf(model.patches), cut.nodes, budget, 8 << 20,
                                           tempDir(), [&](const EdgeKey& key) {
                                               const std::lock_guard lock(mutex);
                                               EXPECT_TRUE(borders.insert(key).second);
                                           });
    EXPECT_EQ(borders.size(), report.border_edges);
    EXPECT_GT(borders.size(), 10u);
}

}  // namespace
}  // namespace pietra
