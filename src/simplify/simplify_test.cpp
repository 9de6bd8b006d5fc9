#include "simplify/simplify.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <set>

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
    float droppable_error = 0;

    SimplifyInput input() const {
        SimplifyInput in;
        in.mesh = &mesh;
        in.cell = cell;
        in.quota = quota;
        in.shift = shift;
        in.droppable_error = droppable_error;
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

/// Cells by octant of the mesh's box around its middle.
Case octantCase(const Mesh& mesh, double ratio) {
    Case c;
    c.mesh = mesh;
    Vec3i low = mesh.position[0], high = low;
    for (const Vec3i& p : mesh.position) low = glm::min(low, p), high = glm::max(high, p);
    c.quota.assign(8, 0);
    for (const Triangle& t : mesh.triangle) {
        const Vec3i sum = mesh.position[t[0]] + mesh.position[t[1]] + mesh.position[t[2]];
        uint8_t octant = 0;
        for (int axis = 0; axis < 3; ++axis)
            octant |= uint8_t((sum[axis] * 2 > 3 * (low[axis] + high[axis])) << axis);
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

/// Vertices of edges used here otherwise than their class says: the rule, written down naively.
std::vector<bool> lockedByTheRule(const Mesh& mesh) {
    std::map<std::pair<uint32_t, uint32_t>, std::vector<EdgeClass>> uses;
    for (size_t t = 0; t < mesh.triangleCount(); ++t)
        for (int k = 0; k < 3; ++k)
            uses[edgeOf(mesh.triangle[t][k], mesh.triangle[t][(k + 1) % 3])].push_back(
                mesh.edgeClass(t, k));
    std::vector<bool> locked(mesh.vertexCount(), false);
    for (const auto& [edge, classes] : uses) {
        const EdgeClass c = classes[0];
        const size_t expected = c == EdgeClass::kManifold ? 2
                                : c == EdgeClass::kBorder ? 1
                                : c == EdgeClass::kTriple ? 3
                                                          : 0;
        const bool agree = std::all_of(classes.begin(), classes.end(),
                                       [&](EdgeClass other) { return other == c; });
        if (!agree || classes.size() != expected) locked[edge.first] = locked[edge.second] = true;
    }
    return locked;
}

/// Uses of each edge whose ends are both at the given positions, by position.
using PlacedEdge = std::pair<uint64_t, uint64_t>;
std::map<PlacedEdge, int> outerEdges(const Mesh& mesh, const std::set<uint64_t>& locked) {
    std::map<PlacedEdge, int> uses;
    for (const Triangle& t : mesh.triangle)
        for (int k = 0; k < 3; ++k) {
            const uint64_t a = latticeKey(mesh.position[t[k]]);
            const uint64_t b = latticeKey(mesh.position[t[(k + 1) % 3]]);
            if (locked.count(a) && locked.count(b)) ++uses[{std::min(a, b), std::max(a, b)}];
        }
    return uses;
}

void expectSound(const Mesh& mesh) {
    std::set<uint64_t> positions;
    for (const Vec3i& p : mesh.position) positions.insert(latticeKey(p));
    EXPECT_EQ(positions.size(), mesh.vertexCount()) << "two vertices at one position";
    std::set<std::array<uint32_t, 3>> seen;
    std::vector<bool> used(mesh.vertexCount(), false);
    size_t degenerate = 0;
    for (const Triangle& t : mesh.triangle) {
        std::array<uint32_t, 3> sorted = t;
        std::sort(sorted.begin(), sorted.end());
        degenerate += sorted[0] == sorted[1] || sorted[1] == sorted[2];
        EXPECT_TRUE(seen.insert(sorted).second) << "doubled triangle";
        for (const uint32_t v : t) used[v] = true;
        using Vec3l = glm::i64vec3;
        const Vec3l a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
        const Vec3l p = b - a, q = c - a;
        degenerate += p.y * q.z == p.z * q.y && p.z * q.x == p.x * q.z && p.x * q.y == p.y * q.x;
    }
    EXPECT_EQ(degenerate, 0u);
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

/// Locked vertices stay, edges among them keep their uses, inner edges match their classes.
void expectBorderKept(const Case& c, const SimplifyOutput& out) {
    const std::vector<bool> locked = lockedByTheRule(c.mesh);
    std::set<uint64_t> locked_positions;
    for (uint32_t v = 0; v < c.mesh.vertexCount(); ++v) {
        if (!locked[v]) continue;
        locked_positions.insert(latticeKey(c.mesh.position[v]));
        ASSERT_NE(out.vertex_map[v], kNone);
        EXPECT_EQ(out.mesh.position[out.vertex_map[v]], c.mesh.position[v]);
    }
    EXPECT_EQ(out.locked_vertices, locked_positions.size());
    EXPECT_EQ(outerEdges(c.mesh, locked_positions), outerEdges(out.mesh, locked_positions));
    std::map<std::pair<uint32_t, uint32_t>, std::vector<EdgeClass>> classes;
    for (size_t t = 0; t < out.mesh.triangleCount(); ++t)
        for (int k = 0; k < 3; ++k)
            classes[edgeOf(out.mesh.triangle[t][k], out.mesh.triangle[t][(k + 1) % 3])].push_back(
                out.mesh.edgeClass(t, k));
    for (const auto& [edge, list] : classes) {
        if (locked_positions.count(latticeKey(out.mesh.position[edge.first])) &&
            locked_positions.count(latticeKey(out.mesh.position[edge.second])))
            continue;
        for (const EdgeClass k : list) EXPECT_EQ(k, classOfUses(int(list.size())));
    }
}

void expectQuotasMet(const Case& c, const SimplifyOutput& out) {
    std::vector<uint32_t> count(c.quota.size(), 0);
    for (const uint8_t cell : out.cell) ++count[cell];
    for (size_t i = 0; i < count.size(); ++i) EXPECT_LE(count[i], c.quota[i]) << "cell " << i;
}

void expectAllInvariants(const Case& c, const SimplifyOutput& out) {
    expectSound(out.mesh);
    expectMapsFit(c, out);
    expectBorderKept(c, out);
}

bool sameMesh(const Mesh& a, const Mesh& b) {
    return a.position == b.position && a.triangle == b.triangle && a.edge_class == b.edge_class &&
           a.normal == b.normal && a.colour == b.colour;
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
