#include "simplify/simplify.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <random>
#include <set>

#include "geometry/bounds.h"
#include "simplify/test_meshes.h"

namespace pietra {
namespace {

using namespace test;

/// A diamond to simplify, owning what SimplifyInput borrows.
struct Case {
    Mesh mesh;
    std::vector<uint8_t> cell;
    std::vector<uint32_t> quota;
    int shift = 0;
    float free_error = 0;
    int scalar_count = 0;

    SimplifyInput input() const {
        SimplifyInput in;
        in.mesh = &mesh;
        in.cell = cell;
        in.quota = quota;
        in.shift = shift;
        in.free_error = free_error;
        in.scalar_count = scalar_count;
        return in;
    }
};

/// One cell, to be reduced to `ratio`.
Case wholeCase(const Mesh& mesh, double ratio) {
    Case c;
    c.mesh = mesh;
    c.cell.assign(mesh.triangleCount(), 0);
    c.quota = {uint32_t(double(mesh.triangleCount()) * ratio)};
    return c;
}

Vec3d middleOf(const Mesh& mesh) {
    Box3i box;
    for (const Vec3i& p : mesh.position) box.add(p);
    return Vec3d(box.min + box.max) * 0.5;
}

/// Cells by octant of the mesh's box around its middle.
Case octantCase(const Mesh& mesh, double ratio) {
    Case c;
    c.mesh = mesh;
    const Vec3d middle = middleOf(mesh);
    c.quota.assign(8, 0);
    for (const Triangle& t : mesh.triangle) {
        const Vec3i sum = mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]];
        uint8_t octant = 0;
        for (int axis = 0; axis < 3; ++axis)
            octant |= uint8_t((sum[axis] > 3 * middle[axis]) << axis);
        c.cell.push_back(octant);
        ++c.quota[octant];
    }
    for (uint32_t& q : c.quota) q = uint32_t(q * ratio);
    return c;
}

SimplifyOutput simplify(const Case& c) {
    Simplifier simplifier;
    SimplifyOutput out;
    simplifier.run(c.input(), out);
    return out;
}

/// Edges by the positions of their ends: the classes that their triangles here give them, sorted.
using PlacedEdge = std::pair<uint64_t, uint64_t>;
using EdgeClasses = std::map<PlacedEdge, std::vector<EdgeClass>>;

EdgeClasses edgeClasses(const Mesh& mesh) {
    EdgeClasses edges;
    for (size_t t = 0; t < mesh.triangleCount(); ++t)
        for (int k = 0; k < 3; ++k) {
            const uint64_t a = latticeKey(mesh.position[mesh.triangle[t][k]]);
            const uint64_t b = latticeKey(mesh.position[mesh.triangle[t][(k + 1) % 3]]);
            edges[{std::min(a, b), std::max(a, b)}].push_back(mesh.edgeClass(t, k));
        }
    for (auto& [edge, classes] : edges) std::sort(classes.begin(), classes.end());
    return edges;
}

/// All its triangles are here, and agree on the class.
bool isComplete(const std::vector<EdgeClass>& classes) {
    return classes.front() == classes.back() && classes[0] != EdgeClass::kMany &&
           classes[0] == classOfUses(int(classes.size()));
}

bool hasArea(const Mesh& mesh, size_t t) {
    using Vec3l = glm::i64vec3;
    const Triangle& v = mesh.triangle[t];
    const Vec3l a(mesh.position[v[0]]), b(mesh.position[v[1]]), c(mesh.position[v[2]]);
    const Vec3l p = b - a, q = c - a;
    return p.y * q.z != p.z * q.y || p.z * q.x != p.x * q.z || p.x * q.y != p.y * q.x;
}

void expectSound(const Mesh& mesh) {
    std::set<uint64_t> positions;
    for (const Vec3i& p : mesh.position) positions.insert(latticeKey(p));
    EXPECT_EQ(positions.size(), mesh.vertexCount()) << "two vertices at one position";
    std::set<std::array<uint32_t, 3>> seen;
    std::vector<bool> used(mesh.vertexCount(), false);
    for (const Triangle& t : mesh.triangle) {
        std::array<uint32_t, 3> sorted = t;
        std::sort(sorted.begin(), sorted.end());
        EXPECT_TRUE(sorted[0] != sorted[1] && sorted[1] != sorted[2]);
        EXPECT_TRUE(seen.insert(sorted).second) << "doubled triangle";
        for (const uint32_t v : t) used[v] = true;
    }
    EXPECT_TRUE(std::all_of(used.begin(), used.end(), [](bool u) { return u; }));
    EXPECT_EQ(mesh.edge_class.size(), mesh.triangleCount());
    EXPECT_EQ(mesh.normal.size(), mesh.vertexCount());
}

void expectMapsFit(const Case& c, const SimplifyOutput& out) {
    ASSERT_EQ(out.vertex_map.size(), c.mesh.vertexCount());
    ASSERT_EQ(out.triangle_map.size(), c.mesh.triangleCount());
    ASSERT_EQ(out.cell.size(), out.mesh.triangleCount());
    ASSERT_EQ(out.triangle_changed.size(), out.mesh.triangleCount());
    std::vector<bool> hit(out.mesh.triangleCount(), false);
    for (size_t t = 0; t < c.mesh.triangleCount(); ++t) {
        const uint32_t to = out.triangle_map[t];
        if (to == kNone) continue;
        ASSERT_LT(to, out.mesh.triangleCount());
        ASSERT_FALSE(hit[to]);
        hit[to] = true;
        EXPECT_EQ(out.cell[to], c.cell[t]);
        if (!hasArea(out.mesh, to)) {
            EXPECT_FALSE(hasArea(c.mesh, t));
            EXPECT_EQ(out.triangle_changed[to], 0);
        }
        bool moved = false;
        for (int k = 0; k < 3; ++k) {
            const uint32_t old_vertex = c.mesh.triangle[t][k];
            EXPECT_EQ(out.vertex_map[old_vertex], out.mesh.triangle[to][k]);
            moved |= c.mesh.position[old_vertex] != out.mesh.position[out.mesh.triangle[to][k]];
        }
        EXPECT_EQ(moved, out.triangle_changed[to] != 0);
    }
    EXPECT_TRUE(std::all_of(hit.begin(), hit.end(), [](bool h) { return h; }));
}

/// Edges used elsewhere too keep their triangles and classes, their ends stay; no new edges join
/// such ends; all other edges have as many triangles as their class says.
void expectBorderKept(const Case& c, const SimplifyOutput& out) {
    const EdgeClasses before = edgeClasses(c.mesh), after = edgeClasses(out.mesh);
    std::set<uint64_t> locked;
    for (const auto& [edge, classes] : before) {
        if (isComplete(classes)) continue;
        locked.insert({edge.first, edge.second});
        const auto found = after.find(edge);
        ASSERT_NE(found, after.end());
        EXPECT_EQ(found->second, classes);
    }
    EXPECT_EQ(out.locked_vertices, locked.size());
    for (uint32_t v = 0; v < c.mesh.vertexCount(); ++v) {
        if (!locked.count(latticeKey(c.mesh.position[v]))) continue;
        ASSERT_NE(out.vertex_map[v], kNone);
        EXPECT_EQ(out.mesh.position[out.vertex_map[v]], c.mesh.position[v]);
    }
    for (const auto& [edge, classes] : after) {
        const auto old = before.find(edge);
        if (old != before.end() && !isComplete(old->second)) continue;
        for (const EdgeClass k : classes) EXPECT_EQ(k, classOfUses(int(classes.size())));
        if (old == before.end()) {
            EXPECT_FALSE(locked.count(edge.first) && locked.count(edge.second));
        }
    }
}

void expectQuotasMet(const Case& c, const SimplifyOutput& out) {
    std::vector<uint32_t> count(c.quota.size(), 0);
    for (const uint8_t cell : out.cell) ++count[cell];
    // What topology holds on to is let go a little above the quota.
    for (size_t i = 0; i < count.size(); ++i)
        EXPECT_LE(count[i], c.quota[i] * 5 / 4 + 1) << "cell " << i;
}

void expectAllInvariants(const Case& c, const SimplifyOutput& out) {
    expectSound(out.mesh);
    expectMapsFit(c, out);
    expectBorderKept(c, out);
}

bool sameMesh(const Mesh& a, const Mesh& b) {
    return a.position == b.position && a.triangle == b.triangle && a.edge_class == b.edge_class &&
           a.normal == b.normal && a.colour == b.colour && a.scalar == b.scalar;
}

long eulerCharacteristic(const Mesh& mesh) {
    return long(mesh.vertexCount()) - long(edgeUses(mesh.triangle).size()) +
           long(mesh.triangleCount());
}

bool everyDirectedEdgeOnce(const Mesh& mesh) {
    std::set<std::pair<uint32_t, uint32_t>> seen;
    for (const Triangle& t : mesh.triangle)
        for (int k = 0; k < 3; ++k)
            if (!seen.insert({t[k], t[(k + 1) % 3]}).second) return false;
    return true;
}

TEST(Simplifier, sphereReachesItsQuotasAndStaysASphere) {
    const Case c = octantCase(toLattice(sphereShape(24), 60000), 0.3);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    EXPECT_EQ(out.locked_vertices, 0u);
    EXPECT_EQ(eulerCharacteristic(out.mesh), 2);
    EXPECT_TRUE(everyDirectedEdgeOnce(out.mesh));
    for (const Vec3i& p : out.mesh.position) {
        const double r = glm::length(Vec3d(p) - Vec3d(31000));
        EXPECT_NEAR(r, 30000, 300);
    }
    EXPECT_GT(out.estimated_error, 1);
    EXPECT_LT(out.estimated_error, 600);
}

TEST(Simplifier, sphereCanGoDownToATetrahedron) {
    const Case c = wholeCase(toLattice(sphereShape(12), 60000), 0.0025);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    EXPECT_EQ(out.mesh.triangleCount(), 4u);
}

TEST(Simplifier, flatGridKeepsItsBorderStraightAndItsCornersSharp) {
    const Case c = octantCase(toLattice(gridShape(32, 0), 32000), 0.05);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    EXPECT_EQ(eulerCharacteristic(out.mesh), 1);
    EXPECT_TRUE(everyDirectedEdgeOnce(out.mesh));
    double area = 0;
    for (const Triangle& t : out.mesh.triangle)
        area +=
            0.5 * glm::length(glm::cross(Vec3d(out.mesh.position[t[1]] - out.mesh.position[t[0]]),
                                         Vec3d(out.mesh.position[t[2]] - out.mesh.position[t[0]])));
    EXPECT_NEAR(area / (32000.0 * 32000.0), 1, 1e-3);
}

TEST(Simplifier, wavyGridKeepsOneBorder) {
    const Case c = octantCase(toLattice(gridShape(40, 0.1), 40000), 0.2);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    EXPECT_EQ(eulerCharacteristic(out.mesh), 1);
}

// By the mean distance alone, spikes of one vertex are cut off when rough ground is.
TEST(Simplifier, spikesOutlastTheRoughGround) {
    Shape grid = gridShape(60, 0);
    std::mt19937 random(5);
    std::uniform_real_distribution<double> noise(0, 0.01);
    for (Vec3d& p : grid.position) p.z = noise(random);
    for (size_t i = 5; i < 60; i += 10)
        for (size_t j = 5; j < 60; j += 10) grid.position[61 * i + j].z = 0.04;
    const Case c = wholeCase(toLattice(grid, 1 << 16), 0.1);
    const SimplifyOutput out = simplify(c);
    size_t spikes = 0;
    for (const Vec3i& p : out.mesh.position)
        spikes += p.z - middleOf(out.mesh).z > 0.01 * (1 << 16);
    EXPECT_GE(spikes, 30u);
}

TEST(Simplifier, goesOnWhereThatLosesLessThanIsLostAnyhow) {
    Case c = wholeCase(toLattice(gridShape(40, 0.01), 1 << 16), 1);
    EXPECT_EQ(simplify(c).collapses, 0u);
    c.free_error = (1 << 16) / 100;
    const SimplifyOutput out = simplify(c);
    EXPECT_LT(out.mesh.triangleCount(), c.mesh.triangleCount() / 4);
    EXPECT_LT(out.estimated_error, c.free_error);
    expectAllInvariants(c, out);
}

TEST(Simplifier, outerBorderIsKeptEdgeByEdge) {
    Mesh whole = toLattice(gridShape(40, 0.1), 40000);
    const Case c = octantCase(extract(whole, [&](uint32_t t) { return t % 80 < 50; }), 0.2);
    const SimplifyOutput out = simplify(c);
    EXPECT_GT(out.locked_vertices, 40u);
    expectAllInvariants(c, out);
    EXPECT_LT(out.mesh.triangleCount(), c.mesh.triangleCount() / 3);
}

TEST(Simplifier, bookOfThreePagesKeepsItsSpine) {
    const Case c = wholeCase(toLattice(bookShape(20), 20000), 0.1);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    EXPECT_EQ(eulerCharacteristic(out.mesh), 1);
    int spine = 0;
    for (const auto& [edge, uses] : edgeUses(out.mesh.triangle)) spine += uses == 3;
    EXPECT_GE(spine, 1);
    EXPECT_LT(spine, 20);
}

TEST(Simplifier, sameBytesTwiceAlsoWhenReused) {
    const Case a = octantCase(toLattice(sphereShape(16), 50000), 0.4);
    const Case b = wholeCase(toLattice(bookShape(12), 30000), 0.3);
    const SimplifyOutput first = simplify(a);
    Simplifier reused;
    SimplifyOutput out;
    reused.run(b.input(), out);
    reused.run(a.input(), out);
    EXPECT_TRUE(sameMesh(first.mesh, out.mesh));
    EXPECT_EQ(first.vertex_map, out.vertex_map);
    EXPECT_EQ(first.triangle_map, out.triangle_map);
}

TEST(Simplifier, halvesSimplifiedApartStillMatch) {
    const Mesh whole =
        toLattice(subdivide(shapeOf(toLattice(sphereShape(14), 100000)), 0.1, 5), 100000);
    const auto left = [&](uint32_t t) {
        const Triangle& c = whole.triangle[t];
        return whole.position[c[0]].x + whole.position[c[1]].x + whole.position[c[2]].x < 3 * 45000;
    };
    const Case a = wholeCase(extract(whole, left), 0.3);
    const Case b = wholeCase(extract(whole, [&](uint32_t t) { return !left(t); }), 0.5);
    const SimplifyOutput out_a = simplify(a), out_b = simplify(b);
    expectAllInvariants(a, out_a);
    expectAllInvariants(b, out_b);
    std::map<PlacedEdge, int> uses;
    std::set<std::pair<uint64_t, uint64_t>> directed;
    for (const Mesh* m : {&out_a.mesh, &out_b.mesh})
        for (const Triangle& t : m->triangle)
            for (int k = 0; k < 3; ++k) {
                const uint64_t p = latticeKey(m->position[t[k]]);
                const uint64_t q = latticeKey(m->position[t[(k + 1) % 3]]);
                ++uses[{std::min(p, q), std::max(p, q)}];
                EXPECT_TRUE(directed.insert({p, q}).second);
            }
    for (const auto& [edge, count] : uses) EXPECT_EQ(count, 2);
}

TEST(Simplifier, newVerticesLieOnTheCoarserLattice) {
    Case c = wholeCase(toLattice(sphereShape(16), 100000), 0.4);
    c.shift = 5;
    const SimplifyOutput out = simplify(c);
    expectSound(out.mesh);
    const std::set<uint64_t> old = [&] {
        std::set<uint64_t> keys;
        for (const Vec3i& p : c.mesh.position) keys.insert(latticeKey(p));
        return keys;
    }();
    for (const Vec3i& p : out.mesh.position)
        if (!old.count(latticeKey(p))) {
            EXPECT_EQ(p, snapToShift(p, 5));
        }
}

TEST(Simplifier, dustIsDroppedSmallestFirst) {
    Case c = wholeCase(toLattice(dustShape(300, 0.01, 1), 100000), 0.5);
    c.free_error = 1e5f;
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    EXPECT_EQ(out.collapses, 0u);
    EXPECT_EQ(out.dropped_triangles, 600u);
    EXPECT_EQ(out.clustered, 0u);
    const auto diagonal = [&](size_t t) {
        Vec3i low = c.mesh.position[c.mesh.triangle[t][0]], high = low;
        for (size_t f = t / 4 * 4; f < t / 4 * 4 + 4; ++f)
            for (const uint32_t v : c.mesh.triangle[f]) {
                low = glm::min(low, c.mesh.position[v]);
                high = glm::max(high, c.mesh.position[v]);
            }
        return glm::length(Vec3d(high - low));
    };
    double largest_gone = 0, smallest_kept = 1e9;
    for (size_t t = 0; t < c.mesh.triangleCount(); ++t)
        if (out.triangle_map[t] == kNone)
            largest_gone = std::max(largest_gone, diagonal(t));
        else
            smallest_kept = std::min(smallest_kept, diagonal(t));
    EXPECT_LE(largest_gone, smallest_kept);
}

TEST(Simplifier, dustTooLargeToDropForTheErrorGoesForTheQuota) {
    const Case c = octantCase(toLattice(dustShape(400, 0.05, 2), 100000), 0.25);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    EXPECT_GT(out.dropped_triangles, 0u);
    EXPECT_EQ(out.clustered, 0u);
}

/// The surface of a slab of (2n+1)^2 cubes, of which n^2 are missing: as many tunnels.
Shape slabWithTunnels(int n) {
    Shape shape;
    std::map<std::array<int, 3>, uint32_t> index;
    const auto solid = [&](int x, int y, int z) {
        return x >= 0 && y >= 0 && x <= 2 * n && y <= 2 * n && z == 0 && !(x % 2 && y % 2);
    };
    const auto vertex = [&](std::array<int, 3> p) {
        const auto [at, is_new] = index.try_emplace(p, uint32_t(shape.position.size()));
        if (is_new) shape.position.push_back({double(p[0]), double(p[1]), double(p[2])});
        return at->second;
    };
    for (int x = 0; x <= 2 * n; ++x)
        for (int y = 0; y <= 2 * n; ++y)
            for (int axis = 0; axis < 3; ++axis)
                for (int side : {0, 1}) {
                    std::array<int, 3> beyond{x, y, 0};
                    beyond[size_t(axis)] += side ? 1 : -1;
                    if (!solid(x, y, 0) || solid(beyond[0], beyond[1], beyond[2])) continue;
                    uint32_t v[4];
                    for (int k = 0; k < 4; ++k) {
                        std::array<int, 3> p{x, y, 0};
                        p[size_t(axis)] += side;
                        p[size_t((axis + 1) % 3)] += k == 1 || k == 2;
                        p[size_t((axis + 2) % 3)] += k >= 2;
                        v[k] = vertex(p);
                    }
                    if (!side) std::swap(v[1], v[3]);
                    shape.triangle.push_back({v[0], v[1], v[2]});
                    shape.triangle.push_back({v[0], v[2], v[3]});
                }
    return shape;
}

TEST(Simplifier, foamIsClusteredWithoutOpeningHoles) {
    const Case c = wholeCase(toLattice(slabWithTunnels(12), 1000), 0.01);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    EXPECT_GT(out.clustered, 0u);
    EXPECT_LE(out.mesh.triangleCount(), c.quota[0] * 3 + 1);
    for (size_t t = 0; t < out.mesh.triangleCount(); ++t)
        for (int k = 0; k < 3; ++k) {
            EXPECT_NE(out.mesh.edgeClass(t, k), EdgeClass::kBorder);
            EXPECT_NE(out.mesh.edgeClass(t, k), EdgeClass::kTriple);
        }
}

TEST(Simplifier, soupReachesItsQuotas) {
    for (const double size : {0.02, 0.2, 1.0}) {
        const Case c = octantCase(toLattice(soupShape(2000, size, 3), 100000), 0.3);
        const SimplifyOutput out = simplify(c);
        expectAllInvariants(c, out);
        expectQuotasMet(c, out);
        EXPECT_GT(out.mesh.triangleCount(), 100u);
    }
}

TEST(Simplifier, somethingAlwaysRemains) {
    for (const Shape& shape : {dustShape(1, 1, 4), dustShape(7, 0.1, 4), soupShape(5, 1, 4),
                               soupShape(1, 1, 4), gridShape(3, 0)}) {
        Case c = wholeCase(toLattice(shape, 1000), 0);
        c.free_error = 1e9f;
        const SimplifyOutput out = simplify(c);
        expectAllInvariants(c, out);
        EXPECT_GE(out.mesh.triangleCount(), 1u);
    }
}

TEST(Simplifier, soupCutInTwoStillMatches) {
    // Dust next to a locked border: the border's triangles must survive as they are.
    Shape dense = gridShape(20, 0.3);
    const Shape dust = dustShape(300, 0.1, 6);
    const uint32_t first = uint32_t(dense.position.size());
    dense.position.insert(dense.position.end(), dust.position.begin(), dust.position.end());
    for (const Triangle& t : dust.triangle)
        dense.triangle.push_back({t[0] + first, t[1] + first, t[2] + first});
    const Mesh whole = toLattice(dense, 100000);
    const auto middle = [&](uint32_t t) {
        const Triangle& v = whole.triangle[t];
        return whole.position[v[0]].x + whole.position[v[1]].x + whole.position[v[2]].x < 150000;
    };
    for (const bool side : {false, true}) {
        const Case c =
            wholeCase(extract(whole, [&](uint32_t t) { return middle(t) == side; }), 0.1);
        const SimplifyOutput out = simplify(c);
        EXPECT_GT(out.locked_vertices, 20u);
        EXPECT_GT(out.dropped_triangles, 0u);
        expectAllInvariants(c, out);
    }
}

TEST(Simplifier, emptyMeshStaysEmpty) {
    const SimplifyOutput out = simplify(Case{});
    EXPECT_EQ(out.mesh.triangleCount(), 0u);
    EXPECT_EQ(out.mesh.vertexCount(), 0u);
}

/// A sphere, a book, a grid, dust and soup on a lattice so coarse that they touch all over.
Mesh messyMesh(unsigned seed) {
    std::mt19937 random(seed);
    Shape all;
    const auto append = [&](const Shape& s, double scale) {
        std::uniform_real_distribution<double> unit(0, 1);
        const Vec3d shift(unit(random), unit(random), unit(random));
        const uint32_t first = uint32_t(all.position.size());
        for (const Vec3d& p : s.position) all.position.push_back(p * scale + shift);
        for (const Triangle& t : s.triangle)
            if (random() % 50 != 0)
                all.triangle.push_back({t[0] + first, t[1] + first, t[2] + first});
    };
    append(sphereShape(8), 0.5);
    append(bookShape(10), 1);
    append(gridShape(12, 0.2), 1);
    append(dustShape(30, 0.05, seed), 1);
    append(soupShape(40, 0.2, seed), 1);
    return toLattice(all, 30 << seed % 8);
}

TEST(Simplifier, invariantsHoldOnRandomMesses) {
    for (unsigned seed = 0; seed < 150; ++seed) {
        SCOPED_TRACE(seed);
        const Mesh whole = messyMesh(seed);
        std::mt19937 random(seed);
        const Vec3d middle = middleOf(whole);
        std::normal_distribution<double> gauss;
        const Vec3d normal{gauss(random), gauss(random), gauss(random)};
        const auto side = [&](uint32_t t) {
            Vec3d sum(0);
            for (const uint32_t v : whole.triangle[t]) sum += Vec3d(whole.position[v]) - middle;
            return glm::dot(sum, normal) > 0;
        };
        const double ratio = double(random() % 60) / 100;
        for (const bool wanted : {false, true}) {
            Case c =
                octantCase(extract(whole, [&](uint32_t t) { return side(t) == wanted; }), ratio);
            c.shift = int(seed % 3);
            const SimplifyOutput out = simplify(c);
            expectAllInvariants(c, out);
            if (::testing::Test::HasFailure()) return;
        }
    }
}

/// A flat grid of 60 x 60 squares, 60000 wide, with colours and one scalar from functions of x and
/// y in 0..1.
template <class Colour, class Scalar>
Case paintedGrid(const Colour& colour, const Scalar& scalar, double ratio) {
    Case c = wholeCase(toLattice(gridShape(60, 0), 60000), ratio);
    c.scalar_count = 1;
    for (const Vec3i& p : c.mesh.position) {
        const double x = (p.x - 1000) / 60000.0, y = (p.y - 1000) / 60000.0;
        c.mesh.colour.push_back(colour(x, y));
        c.mesh.scalar.push_back(scalar(x, y));
    }
    return c;
}

/// Calls visit(x, y, colour as doubles, scalar) at the middles of a fine raster over the result.
template <class Visit>
void visitSurface(const Mesh& mesh, const Visit& visit) {
    for (const Triangle& t : mesh.triangle) {
        const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
        const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
        const Vec3d low = glm::min(a, glm::min(b, c)), high = glm::max(a, glm::max(b, c));
        for (double y = std::floor(low.y / 250) * 250 + 125; y < high.y; y += 250)
            for (double x = std::floor(low.x / 250) * 250 + 125; x < high.x; x += 250) {
                const double v = ((x - a.x) * (c.y - a.y) - (y - a.y) * (c.x - a.x)) / area;
                const double w = ((b.x - a.x) * (y - a.y) - (b.y - a.y) * (x - a.x)) / area;
                if (v < 0 || w < 0 || v + w > 1) continue;
                const double weight[3] = {1 - v - w, v, w};
                Vec3d colour(0);
                double scalar = 0;
                for (int k = 0; k < 3; ++k) {
                    const Rgba8 q = mesh.colour[t[k]];
                    colour += weight[k] * Vec3d(q.r, q.g, q.b);
                    scalar += weight[k] * double(mesh.scalar[t[k]]);
                }
                visit((x - 1000) / 60000, (y - 1000) / 60000, colour, scalar);
            }
    }
}

TEST(Simplifier, edgesOfColoursAndScalarsSurvive) {
    // A red disc on blue, and a step of the scalar along a diagonal, on a flat surface.
    const auto inDisc = [](double x, double y) { return std::hypot(x - 0.4, y - 0.6) < 0.25; };
    const Case c = paintedGrid(
        [&](double x, double y) {
            return inDisc(x, y) ? Rgba8{250, 10, 0, 255} : Rgba8{0, 10, 250, 255};
        },
        [](double x, double y) { return x + y > 1 ? 7.0f : -1.0f; }, 0.08);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    double colour_error = 0, scalar_error = 0, count = 0;
    visitSurface(out.mesh, [&](double x, double y, const Vec3d& colour, double scalar) {
        colour_error += std::abs(colour.r - (inDisc(x, y) ? 250 : 0)) / 250;
        scalar_error += std::abs(scalar - (x + y > 1 ? 7 : -1)) / 8;
        ++count;
    });
    // Of the input itself: 0.9 and 1.1 %. Measured: 1.0 and 0.9 %, by interpolation alone 3.4
    // and 4.0.
    EXPECT_LT(colour_error / count, 0.015);
    EXPECT_LT(scalar_error / count, 0.015);
}

TEST(Simplifier, linearColoursAndScalarsStayLinear) {
    const Case c = paintedGrid(
        [](double x, double y) {
            return Rgba8{uint8_t(255 * x + 0.5), uint8_t(255 * y + 0.5), 77,
                         uint8_t(200 * x + 0.5)};
        },
        [](double x, double y) { return float(1000 + 3 * x - 2 * y); }, 0.05);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    expectQuotasMet(c, out);
    visitSurface(out.mesh, [&](double x, double y, const Vec3d& colour, double scalar) {
        EXPECT_NEAR(colour.r, 255 * x, 3);
        EXPECT_NEAR(colour.g, 255 * y, 3);
        EXPECT_NEAR(colour.b, 77, 0.01);
        EXPECT_NEAR(scalar, 1000 + 3 * x - 2 * y, 0.04);
    });
}

TEST(Simplifier, whatIsNoNumberSpreadsNoFurther) {
    const Case c = paintedGrid(
        [](double, double) {
            return Rgba8{1, 2, 3, 4};
        },
        [](double x, double y) { return std::hypot(x - 0.5, y - 0.5) < 0.1 ? NAN : 5.0f; }, 0.2);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    size_t numbers = 0;
    for (size_t v = 0; v < out.mesh.vertexCount(); ++v) {
        const Vec3d p = (Vec3d(out.mesh.position[v]) - 1000.0) / 60000.0;
        if (std::hypot(p.x - 0.5, p.y - 0.5) > 0.2) {
            EXPECT_EQ(out.mesh.scalar[v], 5.0f);
            ++numbers;
        }
        EXPECT_EQ(out.mesh.colour[v], (Rgba8{1, 2, 3, 4}));
    }
    EXPECT_GT(numbers, 50u);
}

TEST(Simplifier, verticesThatStayKeepTheirAttributes) {
    Mesh whole = toLattice(gridShape(40, 0.1), 40000);
    std::mt19937 random(3);
    for (uint32_t v = 0; v < whole.vertexCount(); ++v) {
        whole.colour.push_back(
            {uint8_t(random()), uint8_t(random()), uint8_t(random()), uint8_t(random())});
        whole.normal[v] = encodeNormal({float(random() % 99) - 49, float(random() % 99) - 49, 9});
    }
    const Case c = octantCase(extract(whole, [&](uint32_t t) { return t % 80 < 50; }), 0.2);
    const SimplifyOutput out = simplify(c);
    expectAllInvariants(c, out);
    size_t kept = 0;
    const EdgeClasses edges = edgeClasses(c.mesh);
    std::set<uint64_t> staying;
    for (const auto& [edge, classes] : edges)
        if (!isComplete(classes) || classes[0] == EdgeClass::kBorder)
            staying.insert({edge.first, edge.second});
    std::map<uint64_t, uint32_t> at;
    for (uint32_t v = 0; v < c.mesh.vertexCount(); ++v) at[latticeKey(c.mesh.position[v])] = v;
    for (uint32_t v = 0; v < out.mesh.vertexCount(); ++v) {
        const uint64_t key = latticeKey(out.mesh.position[v]);
        if (!staying.count(key)) continue;
        ++kept;
        EXPECT_EQ(out.mesh.colour[v], c.mesh.colour[at[key]]);
        EXPECT_EQ(out.mesh.normal[v], c.mesh.normal[at[key]]);
    }
    EXPECT_GT(kept, 50u);
}

TEST(Simplifier, sameBytesOnEveryInstructionSet) {
    Case c = octantCase(
        toLattice(subdivide(shapeOf(toLattice(sphereShape(16), 100000)), 0.1, 5), 100000), 0.3);
    c.scalar_count = 1;
    std::mt19937 random(3);
    for (uint32_t v = 0; v < c.mesh.vertexCount(); ++v) {
        c.mesh.colour.push_back({uint8_t(random()), uint8_t(random()), 9, 255});
        c.mesh.scalar.push_back(float(random() % 1000));
    }
    const Case book = wholeCase(toLattice(bookShape(20), 20000), 0.1);
    const SimplifyOutput first = simplify(c), first_book = simplify(book);
    int targets = 0;
    for (uint64_t all = uint64_t(hwy::SupportedTargets()), target = 1; all != 0; target *= 2) {
        if ((all & target) == 0) continue;
        all &= ~target;
        hwy::SetSupportedTargetsForTest(int64_t(target));
        const SimplifyOutput out = simplify(c), out_book = simplify(book);
        hwy::SetSupportedTargetsForTest(0);
        EXPECT_TRUE(sameMesh(first.mesh, out.mesh)) << hwy::TargetName(int64_t(target));
        EXPECT_TRUE(sameMesh(first_book.mesh, out_book.mesh)) << hwy::TargetName(int64_t(target));
        ++targets;
    }
    EXPECT_GE(targets, 2);
}

TEST(Simplifier, scansKeepTheirTopology) {
    for (const char* name : {"armadillo_86k.obj", "nefertiti.obj"}) {
        const Shape scan = readScan(name);
        if (scan.triangle.empty()) GTEST_SKIP() << "no shared test data";
        const Case c = octantCase(toLattice(scan, 1 << 17), 0.25);
        const SimplifyOutput out = simplify(c);
        expectSound(out.mesh);
        expectMapsFit(c, out);
        expectQuotasMet(c, out);
        EXPECT_EQ(eulerCharacteristic(out.mesh), eulerCharacteristic(c.mesh));
        EXPECT_TRUE(everyDirectedEdgeOnce(out.mesh));
    }
}

}  // namespace
}  // namespace pietra
