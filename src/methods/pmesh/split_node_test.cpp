// Splits in nodes: how they are packed and coded, and what is refused.

#include "methods/pmesh/pmesh_testing.h"
#include "methods/pmesh/split_codec.h"
#include "methods/pmesh/split_faults.h"
#include "methods/pmesh/split_view.h"

namespace pietra::pmesh {
namespace {

SplitForest forestOf(const Mesh& mesh) {
    Budget budget(size_t(1) << 30);
    return buildInCore(mesh, Lattice{}, budget);
}

class EachForest : public testing::TestWithParam<TestMesh> {};
INSTANTIATE_TEST_SUITE_P(Pmesh, EachForest, testing::ValuesIn(testMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(EachForest, KeepsItsRules) {
    const SplitForest forest = forestOf(GetParam().make());
    uint64_t leaves = 0, splits = 0;
    for (const SplitBase::Root& root : forest.base.root) leaves += root.leaves;
    for (NodeIndex n = 0; n < forest.node.size(); ++n) {
        const SplitRow& row = forest.row[n];
        splits += row.splits;
        EXPECT_EQ(faultOf(row, forest.node[n]), "") << n;
        for (const NodeIndex c : row.child) {
            if (c == kNoNode) continue;
            EXPECT_EQ(faultBetween(row, forest.node[n], c, forest.node[c]), "") << n;
            EXPECT_EQ(forest.row[c].parent, n);
            EXPECT_EQ(forest.row[c].level, row.level + 1);
        }
    }
    EXPECT_EQ(leaves, splits + forest.base.root.size());
}

TEST_P(EachForest, SurvivesItsCodec) {
    const SplitForest forest = forestOf(GetParam().make());
    std::string fault;
    for (NodeIndex n = 0; n < forest.node.size(); ++n) {
        SplitNode node;
        ASSERT_TRUE(decodeSplitNode(encodeSplitNode(forest.node[n]), forest.row[n], forest.layout,
                                    node, fault))
            << fault;
        EXPECT_TRUE(node == forest.node[n]) << n;
    }
    SplitForest base;
    base.row = forest.row;
    base.lattice = forest.lattice;
    base.layout = forest.layout;
    ASSERT_TRUE(decodeSplitBase(encodeSplitBase(forest), base, fault)) << fault;
    EXPECT_TRUE(base.base == forest.base);
    EXPECT_TRUE(base.grid == forest.grid);
}

TEST_P(EachForest, TheTableEnclosesItsNodes) {
    const SplitForest forest = forestOf(GetParam().make());
    std::vector<Node> table;
    for (NodeIndex n = 0; n < forest.node.size(); ++n)
        table.push_back(
            tableNode(n, forest.row[n], forest.node[n], forest.lattice, forest.grid, {}));
    std::vector<SplitRow> rows = rowsOf(table);
    setCriteria(table, forest.lattice, forest.grid, rows);
    for (NodeIndex n = 0; n < rows.size(); ++n) {
        EXPECT_TRUE(rows[n].criterion.encloses(forest.row[n].criterion)) << n;
        EXPECT_EQ(rows[n].criterion.error, forest.row[n].criterion.error) << n;
        rows[n].criterion = forest.row[n].criterion;
        EXPECT_TRUE(rows[n] == forest.row[n]) << n;
    }
}

/// So little that leaves are brought to wings a thousand at a time.
TEST_P(EachForest, DoesNotDependOnMemory) {
    const Mesh mesh = GetParam().make();
    const SplitForest forest = forestOf(mesh);
    Budget budget(kBuildBytes * mesh.triangleCount() + 8000);
    const SplitForest same = buildInCore(mesh, Lattice{}, budget);
    EXPECT_TRUE(same.base == forest.base);
    EXPECT_TRUE(same.row == forest.row);
    EXPECT_TRUE(same.node == forest.node);
}

/// Any byte, and any length. What is only another number is found by the file's checksums.
TEST(SplitCodec, RefusesWhatIsDamaged) {
    const SplitForest forest = forestOf(onLattice(dented(test::sphereShape(24), 0.01), 900));
    std::mt19937 random(3);
    uint32_t refused = 0, changed = 0;
    const auto look = [&](std::vector<std::byte> bytes, bool is_base, NodeIndex n) {
        std::string fault;
        if (is_base) {
            SplitForest base;
            base.row = forest.row;
            refused += !decodeSplitBase(bytes, base, fault);
        } else {
            SplitNode node;
            refused += !decodeSplitNode(bytes, forest.row[n], forest.layout, node, fault);
        }
        ++changed;
    };
    for (int i = 0; i < 3000; ++i) {
        const bool is_base = i % 5 == 0;
        const auto n = NodeIndex(random() % forest.node.size());
        std::vector<std::byte> bytes =
            is_base ? encodeSplitBase(forest) : encodeSplitNode(forest.node[n]);
        if (i % 3 == 0)
            bytes.resize(random() % bytes.size());
        else
            bytes[random() % bytes.size()] ^= std::byte(1u << random() % 8);
        look(bytes, is_base, n);
    }
    EXPECT_GT(refused, changed / 2);
}

/// One thing wrong at a time.
TEST(SplitFaults, AreFound) {
    const SplitForest forest = forestOf(onLattice(dented(test::sphereShape(24), 0.01), 900));
    const SplitRow& row = forest.row[0];
    const auto inner = [](const SplitNode& node) {
        for (size_t s = 0; s < node.split.size(); ++s)
            if (node.split[s].child[0] < kSplitSlots) return s;
        return size_t(0);
    };
    const auto fault = [&](auto&& spoil) {
        SplitNode node = forest.node[0];
        VertexSplit& split = node.split[inner(node)];
        spoil(node, split);
        return faultOf(row, node);
    };
    EXPECT_EQ(fault([](SplitNode&, VertexSplit&) {}), "");
    EXPECT_NE(fault([](SplitNode& n, VertexSplit&) { n.split.pop_back(); }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.criterion.error = 0; }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.criterion.error = 0x7f7f; }), "");
    EXPECT_NE(fault([](SplitNode& n, VertexSplit& s) {
                  s.criterion.error = uint16_t(n.split[s.child[0]].criterion.error - 1);
              }),
              "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.leaves[0] += 1; }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.corner[0].v = s.leaves[0]; }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.corner[1].u = s.leaves[1]; }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.corner[0].w = -1; }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.child[0] += 1; }), "");
    EXPECT_NE(fault([](SplitNode&, VertexSplit& s) { s.offset[0].x = 1 << 23; }), "");
    EXPECT_NE(fault([](SplitNode& n, VertexSplit&) { n.frontier = 0; }), "");
    EXPECT_NE(fault([](SplitNode& n, VertexSplit&) { n.child_parts[0].clear(); }), "");

    const NodeIndex child = row.child[0];
    ASSERT_NE(child, kNoNode);
    const auto between = [&](auto&& spoil) {
        SplitNode parent = forest.node[0], node = forest.node[child];
        spoil(parent, node);
        return faultBetween(row, parent, child, node);
    };
    EXPECT_EQ(between([](SplitNode&, SplitNode&) {}), "");
    EXPECT_NE(between([](SplitNode&, SplitNode& n) { n.frontier += 1; }), "");
    EXPECT_NE(between([](SplitNode&, SplitNode& n) { n.split[0].leaves[1] += 1; }), "");
    EXPECT_NE(between([](SplitNode&, SplitNode& n) { n.split[0].criterion.error = 0x7f00; }), "");
}

NestedCriterion randomCriterion(std::mt19937& random) {
    NestedCriterion c;
    for (size_t k = 0; k < 3; ++k) {
        c.min[k] = uint16_t(random() % 2000);
        c.max[k] = uint16_t(c.min[k] + random() % 500);
        c.normals.set(k, int32_t(random() % 8) - 7, int32_t(random() % 8));
    }
    c.error = NestedCriterion::errorUp(float(random() % 1000 + 1) * 0.01f);
    return c;
}

/// What encloses a needed criterion is needed; also behind what hides it.
TEST(SplitView, IsMonotone) {
    std::mt19937 random(17);
    std::uniform_real_distribution<float> any(-1, 1);
    uint32_t needed = 0, hidden = 0, nested = 0;
    for (int i = 0; i < 400; ++i) {
        SplitView view;
        for (float& x : view.eye) x = 1000 + 1500 * any(random);
        view.reach = std::exp2(8 + 4 * any(random));
        view.hides_backs = i % 2 == 0;
        if (i % 3 == 0) {
            Camera camera;
            camera.eye = Vec3d(view.eye[0], view.eye[1], view.eye[2]);
            camera.target = Vec3d(1000 + 300 * any(random), 1000, 1000 + 300 * any(random));
            SeenDepth seen{camera, {320, 240}, {}};
            for (int t = 0; t < seen.columns() * seen.rows(); ++t)
                seen.farthest.push_back(800 + 400 * any(random));
            view = splitView(View(camera, seen.size, Lattice{}), Lattice{}, SplitGrid{}, 1.0);
            view.hides_backs = i % 2 == 0;
            view.occlusion = std::make_shared<Occlusion>(seen, Lattice{}, SplitGrid{});
        }
        for (int j = 0; j < 400; ++j) {
            const NestedCriterion inner = randomCriterion(random);
            NestedCriterion outer = inner.joined(randomCriterion(random));
            if (j % 2 == 0) {
                outer = inner;
                outer.min[random() % 3] -=
                    uint16_t(inner.min[0] > 9 && inner.min[1] > 9 && inner.min[2] > 9);
                outer.max[random() % 3] += uint16_t(random() % 3);
            }
            ASSERT_TRUE(outer.encloses(inner));
            EXPECT_TRUE(outer.encloses(inner.within(outer)) && inner.within(outer) == inner);
            const bool is_needed = view.needs(inner);
            needed += is_needed;
            hidden += !is_needed && view.shows(inner, view.reach);
            nested += !is_needed && view.needs(outer);
            if (is_needed) {
                ASSERT_TRUE(view.needs(outer)) << i << " " << j;
            }
        }
    }
    EXPECT_GT(needed, 1000u);
    EXPECT_GT(hidden, 1000u);
    EXPECT_GT(nested, 1000u);
}

}  // namespace
}  // namespace pietra::pmesh
