// Face-cluster layers: every layer of every cell is a valid mesh of polygons, and every choice of
// layers is one mesh without cracks.

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <numeric>
#include <random>

#include "base/hash.h"
#include "base/parallel.h"
#include "methods/cluster/anchors.h"
#include "methods/cluster/cluster_testing.h"
#include "methods/cluster/layers.h"
#include "methods/cluster/placement.h"
#include "simplify/deviation_surface.h"
#include "simplify/test_meshes.h"

namespace pietra::cluster {
namespace {

struct Input {
    const char* name;
    std::function<Mesh()> make;
    bool orientable = true;
};

/// Two balls, one of which touches the other in a point, and a flat ring.
test::Shape touchingShape() {
    test::Shape shape = test::sphereShape(12);
    const uint32_t base = uint32_t(shape.position.size());
    test::Shape other = test::sphereShape(9);
    const Vec3d touch = shape.position[5];
    const Vec3d shift = touch - other.position[40];
    for (const Vec3d& p : other.position) shape.position.push_back(p + shift);
    for (const auto& [a, b, c] : other.triangle)
        shape.triangle.push_back({base + a, base + b, base + c});
    return shape;
}

/// One band of squares around a cylinder, n squares long.
test::Shape bandShape(int n, int turned) {
    test::Shape shape;
    for (int i = 0; i < n; ++i)
        for (const double side : {-1.0, 1.0}) {
            const double angle = 6.283185307179586 * i / n, tilt = turned * angle / 2;
            const double r = 8 + side * std::sin(tilt);
            shape.position.push_back(
                {r * std::cos(angle), r * std::sin(angle), side * std::cos(tilt)});
        }
    for (int i = 0; i < n; ++i) {
        const bool last = i + 1 == n;
        const uint32_t a = uint32_t(2 * i), b = a + 1;
        uint32_t c = last ? 0 : a + 2, d = last ? 1 : a + 3;
        if (last && turned % 2 != 0) std::swap(c, d);
        shape.triangle.push_back({a, c, b});
        shape.triangle.push_back({b, c, d});
    }
    return shape;
}

test::Shape rough(test::Shape shape, double amount) {
    std::mt19937_64 random(7);
    std::uniform_real_distribution<double> unit(-amount, amount);
    for (Vec3d& p : shape.position) p += Vec3d(unit(random), unit(random), unit(random));
    return shape;
}

const Input kInputs[] = {
    {"ball", [] { return test::toLattice(test::sphereShape(24), 1 << 20); }},
    {"rough ball",
     [] { return test::toLattice(test::subdivide(test::sphereShape(12), 0.3, 3), 1 << 20); }},
    {"sheet", [] { return test::toLattice(test::gridShape(50, 0.2), 1 << 16); }},
    {"crumpled sheet",
     [] { return test::toLattice(rough(test::gridShape(40, 0.2), 0.02), 1 << 10); }},
    {"sheet with holes",
     [] {
         const Mesh sheet = test::toLattice(test::gridShape(60, 0.1), 1 << 16);
         Mesh holes = test::extract(
             sheet, [](uint32_t t) { return (t / 2 % 60 / 5 + t / 120 / 5) % 5 != 2; });
         test::classifyEdges(holes);
         return holes;
     }},
    {"coarse lattice", [] { return test::toLattice(test::gridShape(40, 0.1), 47); }},
    {"book", [] { return test::toLattice(test::bookShape(24), 1 << 16); }},
    {"dust", [] { return test::toLattice(test::dustShape(400, 0.05, 5), 1 << 12); }},
    {"soup", [] { return test::toLattice(test::soupShape(300, 0.2, 5), 1 << 12); }},
    {"touching", [] { return test::toLattice(touchingShape(), 1 << 16); }, false},
    {"band", [] { return test::toLattice(bandShape(120, 0), 1 << 16); }},
    {"Moebius band", [] { return test::toLattice(bandShape(121, 1), 1 << 16); }, false},
};

LayerSettings smallCells(uint32_t vertices) {
    LayerSettings settings;
    settings.cell_vertices = vertices;
    settings.layers = 5;
    return settings;
}

std::vector<uint16_t> sameLayer(const LayeredPiece& piece, uint16_t layer) {
    return std::vector<uint16_t>(piece.cell.size(), layer);
}

std::vector<uint16_t> randomLayers(const LayeredPiece& piece, uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<uint16_t> layers;
    for (size_t c = 0; c < piece.cell.size(); ++c)
        layers.push_back(uint16_t(random() % (piece.layers + 1u)));
    return layers;
}

/// A super face's groups merged, as in the first layer, of a mesh that is one cell.
PolygonMesh firstSuperFaces(const Mesh& mesh, const std::vector<uint8_t>& interface) {
    std::vector<uint32_t> names(mesh.vertexCount());
    std::iota(names.begin(), names.end(), 0u);
    const PolygonMesh polygons =
        polygonsOf(mesh, names, interface, std::vector<uint8_t>(mesh.vertexCount(), 0));
    const Groups groups = clusterFaces(polygons, polygons.faceCount() / 12);
    return mergeFaces(polygons, groups, findAnchors(polygons, groups));
}

TEST(Cluster, AnchorsMoveOutOfCurvedSurfacesAndNeverAtBordersAndInterfaces) {
    const Mesh ball = test::toLattice(test::sphereShape(40), 1 << 20);
    std::vector<uint8_t> interface(ball.vertexCount());
    for (uint32_t v = 0; v < ball.vertexCount(); v += 3) interface[v] = 1;
    const Box3i everywhere{Vec3i(0), Vec3i(kLatticeMax)};
    const PolygonMesh before = firstSuperFaces(ball, interface);
    PolygonMesh after = before;
    const std::vector<MovedAnchor> moved = moveAnchors(after, everywhere);
    std::vector<uint8_t> has_moved(before.vertexCount(), 0);
    for (const MovedAnchor& anchor : moved) {
        has_moved[anchor.vertex] = 1;
        EXPECT_EQ(anchor.from, before.position[anchor.vertex]);
    }
    EXPECT_GT(moved.size(), before.vertexCount() / 4);
    EXPECT_EQ(after.name, before.name);
    Box3d box;
    for (const Vec3i& p : ball.position) box.add(Vec3d(p));
    const auto radius = [&](const Vec3i& p) {
        return glm::length(Vec3d(p) - 0.5 * (box.min + box.max));
    };
    size_t outward = 0;
    for (uint32_t v = 0; v < before.vertexCount(); ++v) {
        EXPECT_EQ(has_moved[v] != 0, after.position[v] != before.position[v]);
        EXPECT_FALSE(has_moved[v] && before.interface_[v]);
        outward += has_moved[v] && radius(after.position[v]) > radius(before.position[v]);
    }
    // Planes through the centroids of faces of a ball meet outside of it.
    EXPECT_GT(outward, moved.size() * 3 / 4);

    PolygonMesh in_room = before;
    const Box3i room{Vec3i(box.min), Vec3i(0.5 * (box.min + box.max))};
    for (const auto& [v, from] : moveAnchors(in_room, room))
        EXPECT_EQ(in_room.position[v], glm::clamp(in_room.position[v], room.min, room.max));

    const Mesh sheet = test::toLattice(test::gridShape(50, 0.2), 1 << 16);
    PolygonMesh open = firstSuperFaces(sheet, std::vector<uint8_t>(sheet.vertexCount(), 0));
    std::vector<uint8_t> at_border(open.vertexCount());
    for (uint32_t h = 0; h < open.halfEdgeCount(); ++h)
        if (open.twin[h] == kNone) at_border[open.corner[h]] = at_border[open.end(h)] = 1;
    const std::vector<MovedAnchor> inner = moveAnchors(open, everywhere);
    EXPECT_FALSE(inner.empty());
    for (const MovedAnchor& anchor : inner) EXPECT_FALSE(at_border[anchor.vertex]);
}

TEST(Cluster, EachLayerIsWhole) {
    for (const Input& input : kInputs) {
        const Mesh mesh = input.make();
        for (const uint32_t vertices : {60u, 1u << 30}) {
            const LayeredPiece piece = buildLayers(mesh, smallCells(vertices));
            for (uint16_t layer = 0; layer <= piece.layers; ++layer) {
                const Mesh whole = mixedMesh(piece, sameLayer(piece, layer));
                const CrackCount cracks = countCracks(whole, mesh, input.orientable);
                EXPECT_TRUE(cracks.ok()) << input.name << ", cells of " << vertices << ", layer "
                                         << layer << ": " << cracks.text();
            }
        }
    }
}

TEST(Cluster, AnyChoiceOfLayersIsWhole) {
    for (const Input& input : kInputs) {
        const Mesh mesh = input.make();
        for (const uint32_t vertices : {20u, 100u}) {
            const LayeredPiece piece = buildLayers(mesh, smallCells(vertices));
            for (uint64_t seed = 0; seed < 6; ++seed) {
                const Mesh mixed = mixedMesh(piece, randomLayers(piece, seed));
                const CrackCount cracks = countCracks(mixed, mesh, input.orientable);
                EXPECT_TRUE(cracks.ok()) << input.name << ", cells of " << vertices << ", choice "
                                         << seed << ": " << cracks.text();
            }
        }
    }
}

/// Eight triangles a cell: nearly everything is at an interface.
TEST(Cluster, TinyCells) {
    for (const Input& input : kInputs) {
        const Mesh mesh = input.make();
        const LayeredPiece piece = buildLayers(mesh, smallCells(5));
        for (uint64_t seed = 0; seed < 3; ++seed) {
            const CrackCount cracks =
                countCracks(mixedMesh(piece, randomLayers(piece, seed)), mesh, input.orientable);
            EXPECT_TRUE(cracks.ok()) << input.name << ", " << seed << ": " << cracks.text();
        }
    }
}

/// Triangles by cellAt(middle of a triangle).
template <class CellAt>
CellTriangles cellsBy(const Mesh& mesh, size_t count, CellAt&& cellAt) {
    CellTriangles cells{std::vector<std::vector<uint32_t>>(count)};
    for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
        Vec3d middle(0);
        for (const uint32_t v : mesh.triangle[t]) middle += Vec3d(mesh.position[v]) / 3.0;
        cells.of_cell[cellAt(middle)].push_back(t);
    }
    std::erase_if(cells.of_cell, [](const auto& list) { return list.empty(); });
    return cells;
}

/// Cells from pole to pole: four interfaces with the same two ends, down to the last vertex. And
/// slabs, whose interfaces are closed.
TEST(Cluster, InterfacesShareEndsOrHaveNone) {
    const Mesh mesh = test::toLattice(test::sphereShape(16), 1 << 16);
    const double half = 0.5 * (1 << 16), centre = 1000 + half;
    const auto lune = [&](const Vec3d& p) {
        return size_t((p.x > centre) + (p.x > centre) + ((p.y > centre) == (p.x > centre)));
    };
    const auto slab = [&](const Vec3d& p) { return size_t((p.z - 1000) / half * 2.5); };
    for (const CellTriangles& cells : {cellsBy(mesh, 4, lune), cellsBy(mesh, 6, slab)}) {
        LayerSettings settings = smallCells(0);
        settings.layers = 16;
        const LayeredPiece piece = buildLayers(mesh, cells, settings);
        for (uint64_t seed = 0; seed < 40; ++seed) {
            const CrackCount cracks =
                countCracks(mixedMesh(piece, randomLayers(piece, seed)), mesh, true);
            EXPECT_TRUE(cracks.ok()) << cracks.text();
        }
    }
}

/// Cells in crumbs, that touch themselves and enclose each other.
TEST(Cluster, AnyPartitionWillDo) {
    for (const Input& input : kInputs) {
        const Mesh mesh = input.make();
        for (const uint64_t grain : {1u, 40u, 400u}) {
            CellTriangles cells{std::vector<std::vector<uint32_t>>(6)};
            for (uint32_t t = 0; t < mesh.triangleCount(); ++t)
                cells.of_cell[mixBits(t / grain) % 6].push_back(t);
            std::erase_if(cells.of_cell, [](const auto& list) { return list.empty(); });
            const LayeredPiece piece = buildLayers(mesh, cells, smallCells(0));
            const CrackCount cracks =
                countCracks(mixedMesh(piece, randomLayers(piece, grain)), mesh, input.orientable);
            EXPECT_TRUE(cracks.ok()) << input.name << ", " << grain << ": " << cracks.text();
        }
    }
}

/// Largest distance of points of `from` to `to`.
double distanceTo(const Mesh& to, const Mesh& from) {
    deviation::Surface surface;
    surface.assign(to);
    double most = 0;
    for (const Triangle& t : from.triangle)
        for (const Vec3d& w : {Vec3d(1, 0, 0), Vec3d(0.5, 0.5, 0), Vec3d(1, 1, 1) / 3.0,
                               Vec3d(0.1, 0.3, 0.6), Vec3d(0.6, 0.1, 0.3)}) {
            const Vec3d p = w[0] * Vec3d(from.position[t[0]]) + w[1] * Vec3d(from.position[t[1]]) +
                            w[2] * Vec3d(from.position[t[2]]);
            const Vec3i origin(glm::floor(p));
            const float value =
                surface.nearest(Vec3f(origin), Vec3f(p - Vec3d(origin)), {}, {0, HUGE_VALF}).value;
            most = std::max(most, double(value));
        }
    return most;
}

/// Whatever is mixed, no point is farther off than the worst cell states; where cells meet in a
/// plane, that is next to nothing.
TEST(Cluster, StatedErrorsHold) {
    for (const Input& input : kInputs) {
        const Mesh mesh = input.make();
        const LayeredPiece piece = buildLayers(mesh, smallCells(100));
        for (uint64_t seed = 0; seed < 4; ++seed) {
            const std::vector<uint16_t> layers = randomLayers(piece, seed);
            float stated = 0;
            for (size_t c = 0; c < layers.size(); ++c)
                stated = std::max(stated, piece.cell[c].error[layers[c]]);
            const Mesh mixed = mixedMesh(piece, layers);
            EXPECT_LE(distanceTo(mixed, mesh), 1.001 * stated + 0.01) << input.name << seed;
            EXPECT_LE(distanceTo(mesh, mixed), 1.001 * stated + 0.01) << input.name << seed;
        }
    }
    const Mesh plane = test::toLattice(test::gridShape(64, 0), 1 << 16);
    const LayeredPiece piece = buildLayers(plane, smallCells(600));
    EXPECT_LE(12, std::count_if(piece.cell.begin(), piece.cell.end(),
                                [](const CellLayers& cell) { return cell.error[2] < 10; }));
}

TEST(Cluster, PolygonsKeepTheirInvariants) {
    for (const Input& input : kInputs) {
        const Mesh mesh = input.make();
        const CellTriangles one = octreeCells(mesh, 1u << 30);
        const Interfaces none(mesh, one);
        std::vector<uint32_t> names(mesh.vertexCount());
        std::iota(names.begin(), names.end(), 0u);
        PolygonMesh layer = polygonsOf(mesh, names, none.atInterface(), none.irregular());
        EXPECT_EQ(faultOf(layer), "") << input.name;
        for (int i = 0; i < 5; ++i) {
            const Groups groups = clusterFaces(layer, layer.faceCount() / 4 + 1);
            layer = mergeFaces(layer, groups, findAnchors(layer, groups));
            EXPECT_EQ(faultOf(layer), "") << input.name << ", step " << i;
        }
    }
}

TEST(Cluster, WithoutStripsThereAreCracks) {
    const Mesh mesh = kInputs[0].make();
    const LayeredPiece piece = buildLayers(mesh, smallCells(100));
    const CrackCount cracks =
        countCracks(mixedMesh(piece, randomLayers(piece, 1), false), mesh, true);
    EXPECT_LT(20u, cracks.cracked) << cracks.text();
}

TEST(Cluster, Layer0IsTheInput) {
    const Mesh mesh = kInputs[1].make();
    const LayeredPiece piece = buildLayers(mesh, smallCells(100));
    const auto corners = [](const Mesh& m) {
        std::multiset<std::array<uint64_t, 3>> all;
        for (const Triangle& t : m.triangle) {
            std::array<uint64_t, 3> keys;
            for (size_t k = 0; k < 3; ++k) keys[k] = latticeKey(m.position[t[k]]);
            std::rotate(keys.begin(), std::min_element(keys.begin(), keys.end()), keys.end());
            all.insert(keys);
        }
        return all;
    };
    EXPECT_EQ(corners(mixedMesh(piece, sameLayer(piece, 0))), corners(mesh));
}

TEST(Cluster, LayersGetFewer) {
    const Mesh mesh = kInputs[0].make();
    LayerSettings settings = smallCells(1u << 30);
    settings.layers = 3;
    const LayeredPiece piece = buildLayers(mesh, settings);
    size_t before = mesh.triangleCount();
    for (uint16_t layer = 1; layer <= 3; ++layer) {
        const size_t count = piece.cell[0].layer[layer].mesh.triangleCount();
        EXPECT_LT(count, before * 2 / 5);
        EXPECT_LT(before / 8, count);
        before = count;
    }
}

TEST(Cluster, TheSameForAnyNumberOfThreads) {
    const Mesh mesh = kInputs[1].make();
    const auto build = [&mesh](int jobs) {
        const ThreadLimit limit(jobs);
        const LayeredPiece piece = buildLayers(mesh, smallCells(100));
        return mixedMesh(piece, randomLayers(piece, 3));
    };
    const Mesh one = build(1), seven = build(7);
    EXPECT_EQ(one.position, seven.position);
    EXPECT_EQ(one.triangle, seven.triangle);
}

}  // namespace
}  // namespace pietra::cluster
