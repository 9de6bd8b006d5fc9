// The octree's layers, and what happens to dust.

#include "methods/cluster/octree.h"

#include <gtest/gtest.h>

#include <cmath>
#include <map>
#include <random>
#include <set>

#include "base/disjoint_sets.h"
#include "methods/cluster/fallback.h"
#include "simplify/test_meshes.h"

namespace pietra::cluster {
namespace {

/// Leaves of very different depth.
std::vector<CellId> unevenLeaves(uint64_t seed) {
    std::mt19937_64 random(seed);
    std::vector<CellId> leaves;
    const auto divide = [&](auto&& self, CellId cell) -> void {
        if (cell > 1 && (random() % 3 != 0 || depthOf(cell) == 7)) {
            if (random() % 4 != 0) leaves.push_back(cell);
            return;
        }
        for (CellId child = cell << 3; child < (cell + 1) << 3; ++child) self(self, child);
    };
    divide(divide, 1);
    if (leaves.empty()) leaves.push_back(8);
    return leaves;
}

/// A node for each cell and layer that there is, in one tree.
TEST(Octree, EveryNodeHasOneParent) {
    size_t uneven = 0;
    for (uint64_t seed = 0; seed < 30; ++seed) {
        const Octree octree(unevenLeaves(seed));
        using Layer = std::pair<CellId, int>;
        std::set<Layer> nodes;
        for (const CellId leaf : octree.leaves()) {
            EXPECT_EQ(octree.leaves()[octree.leafNumber(leaf)], leaf);
            EXPECT_EQ(octree.cellIn(leaf, octree.topLayer()), CellId(1));
            EXPECT_EQ(octree.cellIn(leaf, 0), leaf);
            nodes.insert({leaf, octree.firstLayer(leaf)});
            uneven += octree.firstLayer(leaf) > 0;
        }
        std::map<Layer, Layer> parent;
        for (int layer = 1; layer <= octree.topLayer(); ++layer) {
            CellPath before = 0;
            for (const CellStep& step : octree.stepsOf(layer)) {
                EXPECT_TRUE(nodes.insert({step.cell, layer}).second);
                for (const CellId below : step.below) {
                    EXPECT_TRUE(
                        parent.emplace(Layer(below, layer - 1), Layer(step.cell, layer)).second);
                    EXPECT_TRUE(below == step.cell || below >> 3 == step.cell);
                    EXPECT_LE(before, firstPath(below));
                    before = firstPath(below);
                }
            }
        }
        EXPECT_EQ(parent.size() + 1, nodes.size());
        for (const auto& [child, above] : parent)
            EXPECT_TRUE(nodes.contains(child)) << child.first << " in layer " << child.second;
        EXPECT_EQ(octree.stepsOf(octree.topLayer()).size(), 1u);
    }
    EXPECT_LT(100u, uneven);
}

TEST(Fallback, TheSmallestComponentsGo) {
    const Mesh dust = test::toLattice(test::dustShape(400, 0.05, 5), 1 << 16);
    std::vector<uint32_t> names(dust.vertexCount());
    for (uint32_t v = 0; v < names.size(); ++v) names[v] = v;
    std::vector<uint8_t> at_interface(dust.vertexCount(), 0);
    for (const uint32_t v : dust.triangle[7]) at_interface[v] = 1;
    LayerStep step;
    step.polygons = polygonsOf(dust, names, at_interface, std::vector<uint8_t>(names.size(), 0));
    step.triangles = triangulate(step.polygons);
    for (uint32_t t = 0; t < dust.triangleCount(); ++t) step.triangle_map.push_back(t);
    DisjointSets sets(dust.vertexCount());
    for (const auto& [a, b, c] : dust.triangle) {
        sets.unite(a, b);
        sets.unite(b, c);
    }
    std::map<uint32_t, double> area;  // of components
    for (uint32_t t = 0; t < dust.triangleCount(); ++t)
        area[sets.root(dust.triangle[t][0])] += step.polygons.shape[t].area;
    dropComponents(step, 100);
    EXPECT_EQ(faultOf(step.polygons), "");
    const size_t left = step.triangles.mesh.triangleCount();
    EXPECT_LE(left, 110u);
    EXPECT_LT(80u, left);
    // What went is no larger than what stayed, but for the one that another cell has a part of.
    double largest_gone = 0, least_left = HUGE_VAL;
    const uint32_t shared = sets.root(dust.triangle[7][0]);
    EXPECT_NE(step.triangle_map[7], kNoDeviationIndex);
    for (uint32_t t = 0; t < dust.triangleCount(); ++t) {
        const uint32_t component = sets.root(dust.triangle[t][0]);
        if (component == shared) continue;
        if (step.triangle_map[t] == kNoDeviationIndex)
            largest_gone = std::max(largest_gone, area[component]);
        else
            least_left = std::min(least_left, area[component]);
    }
    EXPECT_LT(0, largest_gone);
    EXPECT_LE(largest_gone, least_left);
}

}  // namespace
}  // namespace pietra::cluster
