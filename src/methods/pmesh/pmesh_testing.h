#pragma once
// What the tests of progressive meshes share: meshes, and what must hold of any active mesh.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "io/memory_source.h"
#include "methods/pmesh/adaption.h"
#include "methods/pmesh/build.h"
#include "methods/pmesh/in_core_builder.h"
#include "simplify/test_meshes.h"

namespace pietra::pmesh {

struct TestMesh {
    const char* name;
    std::function<Mesh()> make;
};

/// `steps`: of the longest side of the box.
inline Mesh onLattice(const test::Shape& shape, int32_t steps) {
    return test::toLattice(shape, steps);
}

/// Two spheres that share one vertex.
inline test::Shape bowTie() {
    test::Shape shape = test::sphereShape(6), other = test::sphereShape(6);
    const uint32_t first = uint32_t(shape.position.size());
    const Vec3d move = shape.position[0] * 2.0;  // its antipode's mirror image touches there
    for (const Vec3d& p : other.position) shape.position.push_back(move - p);
    for (const Triangle& t : other.triangle)
        shape.triangle.push_back({first + t[0], first + t[2], first + t[1]});
    return shape;
}

inline test::Shape dented(test::Shape shape, double amplitude) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, amplitude);
    // Shapes may have several vertices at one place, which must stay together.
    std::map<std::array<int64_t, 3>, Vec3d> moved;
    for (Vec3d& p : shape.position) {
        const auto key = [](double x) { return std::llround(x * 1e9); };
        const auto [it, is_new] = moved.try_emplace({key(p.x), key(p.y), key(p.z)});
        if (is_new) it->second = p + Vec3d(noise(random), noise(random), noise(random));
        p = it->second;
    }
    return shape;
}

/// Long edges with short ones beside them: every other row of a sheet lies close to the next. What
/// moves along the former is too coarse for the latter, without dummies.
inline test::Shape closeRows(int rows) {
    test::Shape sheet = test::gridShape(rows, 0.05);
    for (Vec3d& p : sheet.position) p.y += std::llround(p.y * rows) % 2 == 1 ? 0.99 / rows : 0.0;
    return sheet;
}

inline std::vector<TestMesh> testMeshes() {
    using namespace test;
    return {
        {"ball", [] { return onLattice(dented(sphereShape(16), 0.01), 900); }},
        {"fine_ball", [] { return onLattice(dented(sphereShape(16), 0.01), 1 << 20); }},
        {"bordered", [] { return onLattice(gridShape(40, 0.1), 1200); }},
        {"non_manifold", [] { return onLattice(bookShape(16), 1000); }},
        {"bow_tie", [] { return onLattice(bowTie(), 900); }},
        {"dust", [] { return onLattice(dustShape(60, 0.05, 3), 2000); }},
        {"soup", [] { return onLattice(soupShape(200, 0.05, 3), 2000); }},
    };
}

struct Built {
    Mesh input;
    BuildCounts counts;
    NodeForest forest;
    ProgressiveMesh mesh;
};

inline Built buildFor(const Mesh& input) {
    Built built;
    built.input = input;
    Budget budget(size_t(1) << 30);
    built.forest = buildInCore(input, Lattice{}, budget, &built.counts);
    built.mesh = fromNodes(built.forest);
    return built;
}

/// By diamonds, into a file; positions are the lattice.
inline BuildReport buildFile(const Mesh& mesh, uint32_t leaf_triangles, const std::string& path) {
    std::vector<Vec3d> positions;
    for (const Vec3i& p : mesh.position) positions.push_back(Vec3d(p));
    std::vector<MemorySource::Index> triangles;
    for (const Triangle& t : mesh.triangle) triangles.push_back({t[0], t[1], t[2]});
    MemorySource source(positions, triangles);
    BuildSettings settings;
    settings.output = path;
    settings.force = true;
    settings.memory_bytes = size_t(256) << 20;
    settings.jobs = 2;
    settings.temp_dir = ::testing::TempDir();
    settings.leaf_triangles = leaf_triangles;
    settings.patch_triangles = leaf_triangles;
    settings.precision = {PrecisionSetting::Kind::kStep, 1.0};
    Progress progress;
    return build(source, settings, progress);
}

inline Criterion everything() {
    Criterion criterion = criterionOf(-1.0, Lattice{});
    return criterion;
}
inline Criterion nothing() {
    Criterion criterion = criterionOf(1e30, Lattice{});
    return criterion;
}

/// An eye somewhere in or around the model, and any tolerance.
inline Criterion randomView(std::mt19937& random, const Mesh& mesh) {
    Box3i box;
    for (const Vec3i& p : mesh.position) box.add(p);
    const Vec3d size(box.max - box.min);
    std::uniform_real_distribution<double> place(-0.5, 1.5), power(-4, 6);
    Criterion criterion;
    for (int k = 0; k < 3; ++k) criterion.eye[k] = int32_t(box.min[k] + place(random) * size[k]);
    criterion.hides_backs = random() % 2 == 0;
    const double scale = std::exp2(power(random)) * kErrorUnit * 32;
    for (uint32_t code = 1; code < 256; ++code)
        criterion.reach[code] = int32_t(std::min(double(decodeError(code)) * scale, 0x1p25));
    if (random() % 2 == 0) return criterion;
    // A pyramid, towards somewhere in the model.
    std::normal_distribution<double> any;
    const Vec3d target(mesh.position[random() % mesh.position.size()]);
    const Vec3d forward = glm::normalize(target - Vec3d(criterion.eye) + 0.5);
    for (Vec3i& side : criterion.side) {
        const Vec3d n =
            glm::normalize(forward + 2.0 * Vec3d(any(random), any(random), any(random)));
        side = Vec3i(n * double((1 << Criterion::kSideBits) - 1));
    }
    return criterion;
}

/// What a camera somewhere around saw: near and far in patches of tiles, some of them open.
inline std::shared_ptr<const Occlusion> randomOcclusion(std::mt19937& random, const Mesh& mesh) {
    Box3i box;
    for (const Vec3i& p : mesh.position) box.add(p);
    const double size = glm::length(Vec3d(box.max - box.min));
    std::uniform_real_distribution<double> any(-1, 1);
    SeenDepth seen;
    seen.size = {320, 240};
    seen.camera.target = 0.5 * Vec3d(box.min + box.max) + 0.2 * size * Vec3d(any(random));
    seen.camera.eye =
        seen.camera.target + size * glm::normalize(Vec3d(any(random), any(random), any(random)));
    for (int y = 0; y < seen.rows(); ++y)
        for (int x = 0; x < seen.columns(); ++x) {
            const bool is_new = x % 4 == 0 && y % 3 == 0;
            const auto above = seen.farthest.size() - size_t(y % 3 != 0 ? seen.columns() : 1);
            seen.farthest.push_back(is_new ? random() % 8 == 0
                                                 ? std::numeric_limits<float>::infinity()
                                                 : float(size * (1 + 0.5 * any(random)))
                                           : seen.farthest[above]);
        }
    return std::make_shared<Occlusion>(seen, Lattice());
}

/// By names, each from its least corner, sorted.
inline std::vector<Triangle> namedTriangles(const ActiveMesh& mesh) {
    std::vector<Triangle> triangles;
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) {
        Triangle t;
        for (uint32_t k = 0; k < 3; ++k) t[k] = mesh.pulse[mesh.vertexAt(4 * f + k)].name;
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        triangles.push_back(t);
    }
    std::sort(triangles.begin(), triangles.end());
    return triangles;
}

/// Names, positions and normals, sorted.
inline std::vector<std::pair<uint32_t, std::array<uint32_t, 4>>> namedVertices(
    const ActiveMesh& mesh) {
    std::vector<std::pair<uint32_t, std::array<uint32_t, 4>>> vertices;
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
        const Vertex& p = mesh.vertex[v];
        vertices.push_back(
            {mesh.pulse[v].name, {uint32_t(p.x), uint32_t(p.y), uint32_t(p.z), p.normal}});
    }
    std::sort(vertices.begin(), vertices.end());
    return vertices;
}

inline void expectSame(const ActiveMesh& a, const ActiveMesh& b) {
    EXPECT_EQ(namedTriangles(a), namedTriangles(b));
    EXPECT_EQ(namedVertices(a), namedVertices(b));
}

/// What no operation may change: vertices - edges + faces, how often each edge that the base mesh
/// shares more than twice is used, and the number of half-edges without a twin's loops.
struct Topology {
    int64_t euler = 0;
    uint64_t border_loops = 0;
    bool operator==(const Topology&) const = default;
};

inline Topology topologyOf(const ActiveMesh& mesh) {
    std::map<std::pair<uint32_t, uint32_t>, int> uses;
    std::map<uint32_t, uint32_t> border_next;
    bool simple = true;
    for (uint32_t f = 0; f < mesh.faceCount(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t a = mesh.vertexAt(4 * f + k), b = mesh.vertexAt(4 * f + (k + 1) % 3);
            ++uses[std::minmax(a, b)];
        }
    for (uint32_t f = 0; f < mesh.faceCount(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t a = mesh.vertexAt(4 * f + k), b = mesh.vertexAt(4 * f + (k + 1) % 3);
            if (uses[std::minmax(a, b)] == 1) simple &= border_next.emplace(a, b).second;
        }
    Topology topology;
    topology.euler = int64_t(mesh.vertexCount()) - int64_t(uses.size()) + int64_t(mesh.faceCount());
    std::set<uint32_t> seen;
    for (const auto& [start, unused] : border_next) {
        if (!simple || seen.count(start)) continue;
        ++topology.border_loops;
        for (uint32_t v = start; seen.insert(v).second && border_next.count(v);) v = border_next[v];
    }
    return topology;
}

/// Indices, twins, corners and fans agree; no triangle is degenerate or doubled; what is kept of
/// operations fits.
inline void expectSound(const ActiveMesh& mesh) {
    std::set<Triangle> seen;
    std::vector<uint32_t> corners(mesh.vertexCount(), 0);
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) {
        Triangle t{mesh.vertexAt(4 * f), mesh.vertexAt(4 * f + 1), mesh.vertexAt(4 * f + 2)};
        for (uint32_t k = 0; k < 3; ++k) {
            ASSERT_LT(t[k], mesh.vertexCount());
            ++corners[t[k]];
            const uint32_t twin = mesh.twinOf(4 * f + k);
            if (twin == kNoCorner) continue;
            ASSERT_LT(twin >> 2, mesh.faceCount());
            EXPECT_EQ(mesh.twinOf(twin), 4 * f + k);
            EXPECT_EQ(mesh.vertexAt(twin), t[(k + 1) % 3]);
            EXPECT_EQ(mesh.vertexAt(nextCorner(twin)), t[k]);
        }
        std::sort(t.begin(), t.end());
        EXPECT_TRUE(t[0] != t[1] && t[1] != t[2]) << "degenerate";
        EXPECT_TRUE(seen.insert(t).second) << "doubled";
    }
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
        const VertexRecord& r = mesh.record[v];
        const OperationId none = kNoOperation;
        if (r.next == none || mesh.isNextLoaded(v)) {
            EXPECT_EQ(mesh.pulse[v].next_level,
                      r.next == none ? kLeafLevel : mesh.source().at(r.next).level);
        }
        EXPECT_EQ(mesh.pulse[v].last_level,
                  r.last == none ? 0u : mesh.source().at(r.last).level + 1u);
        if (r.next == none && r.last == none) continue;  // may be irregular
        ASSERT_NE(mesh.pulse[v].corner, kNoCorner);
        EXPECT_EQ(mesh.vertexAt(mesh.pulse[v].corner), v);
        uint32_t reached = 0;
        bool closed = false;
        for (uint32_t c = mesh.pulse[v].corner; c != kNoCorner && !closed;
             closed = c == mesh.pulse[v].corner) {
            ++reached;
            c = mesh.leftOf(c);
        }
        EXPECT_EQ(reached, corners[v]);
        EXPECT_TRUE(closed || mesh.twinOf(mesh.pulse[v].corner) == kNoCorner)
            << "not the first corner";
        uint32_t lower = 0, higher = 0;
        mesh.allNeighbours(v, [&](uint32_t w) {
            lower += mesh.pulse[w].next_level < mesh.pulse[v].next_level;
            higher += mesh.pulse[w].last_level > mesh.pulse[v].last_level;
            const uint16_t level = mesh.pulse[w].next_level;
            EXPECT_TRUE(level != mesh.pulse[v].next_level || level == kLeafLevel) << "equal levels";
            return true;
        });
        EXPECT_EQ(mesh.pulse[v].lower(), lower);
        EXPECT_EQ(mesh.pulse[v].higher(), higher);
    }
}

}  // namespace pietra::pmesh
