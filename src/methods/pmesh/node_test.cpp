// Operations in nodes: how they are packed, and what is refused.

#include <fmt/format.h>

#include "methods/pmesh/node_codec.h"
#include "methods/pmesh/node_packer.h"
#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

class EachForest : public testing::TestWithParam<TestMesh> {};
INSTANTIATE_TEST_SUITE_P(Pmesh, EachForest, testing::ValuesIn(testMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

void expectNoFault(const NodeForest& forest) {
    for (NodeIndex n = 0; n < forest.node.size(); ++n) {
        const NodeRow& row = forest.row[n];
        EXPECT_EQ(faultOf(n, row, forest.node[n]), "") << n;
        for (const NodeIndex c : row.child) {
            if (c == kNoNode) continue;
            EXPECT_EQ(faultBetween(row, forest.node[n], c, forest.node[c]), "") << n;
            EXPECT_EQ(forest.row[c].parent, n);
            EXPECT_EQ(forest.row[c].level, row.level + 1);
        }
    }
}

TEST_P(EachForest, KeepsItsRulesAndItsOperations) {
    const Built built = buildFor(GetParam().make());
    const NodeForest& forest = built.forest;
    expectNoFault(forest);
    uint64_t operations = 0;
    for (const NodeRow& row : forest.row) operations += row.operations;
    EXPECT_EQ(operations, built.counts.operations);
    EXPECT_EQ(validate(built.mesh), "");
    EXPECT_EQ(validateStars(built.mesh), "");
}

TEST_P(EachForest, ANodeIsNeededBeforeAnythingInItOrBelow) {
    const Built built = buildFor(GetParam().make());
    const NodeForest& forest = built.forest;
    std::vector<Vec3i> centre(built.mesh.operation.size());
    for (size_t v = 0; v < built.mesh.base_vertex.size(); ++v)
        if (built.mesh.base_operation[v] != kNoOperation)
            centre[built.mesh.base_operation[v]] = built.mesh.base_vertex[v].position();
    std::mt19937 random(3);
    for (int i = 0; i < 20; ++i) {
        const Criterion view = randomView(random, built.input);
        std::vector<uint8_t> needed(forest.row.size(), 0);
        for (NodeIndex n = 0; n < forest.row.size(); ++n) {
            const NodeRow& row = forest.row[n];
            needed[n] = view.needs(row.centre, row.error, row.radius, NormalBox().word());
            if (needed[n] && row.parent != kNoNode) {
                EXPECT_TRUE(needed[row.parent]);
            }
        }
        for (OperationId id = 0; id < built.mesh.operation.size(); ++id) {
            const Operation& o = built.mesh.operation[id];
            if (o.error == 0) continue;
            if (view.needs(centre[id], o.error, o.radius, o.normals.word())) {
                EXPECT_TRUE(needed[nodeOf(id)]) << id;
            }
            for (const int end : {0, 1})
                if (o.childOf(end) != kNoOperation)
                    centre[o.childOf(end)] = centre[id] + o.offset(end);
        }
    }
}

TEST_P(EachForest, SurvivesItsCodec) {
    const Built built = buildFor(GetParam().make());
    const NodeForest& forest = built.forest;
    std::string fault;
    for (NodeIndex n = 0; n < forest.node.size(); ++n) {
        OperationNode node;
        ASSERT_TRUE(
            decodeNode(encodeNode(forest.node[n]), n, forest.row[n], forest.layout, node, fault))
            << fault;
        EXPECT_EQ(node, forest.node[n]);
    }
    NodeForest base;
    base.row = forest.row;
    ASSERT_TRUE(decodeBase(encodeBase(forest), kMethodFormat, base, fault)) << fault;
    EXPECT_EQ(base.base_vertex, forest.base_vertex);
    EXPECT_EQ(base.base_triangle, forest.base_triangle);
    EXPECT_EQ(base.base_operation, forest.base_operation);
}

/// Also what no normal makes, but a page may hold.
TEST(NodeCodec, KeepsAnyBox) {
    const Built built = buildFor(onLattice(test::sphereShape(8), 900));
    OperationNode node = built.forest.node[0], again;
    node.operation[0].normals.set(0, -8, 7);
    std::string fault;
    ASSERT_TRUE(decodeNode(encodeNode(node), 0, built.forest.row[0], {}, again, fault)) << fault;
    EXPECT_EQ(again, node);
}

/// A tree of operations, or a chain, along a line; or all of them trees of their own.
enum class Shape { kTree, kChain, kLoose };
void makeCollapses(uint32_t count, Shape shape, Collapses& out) {
    std::vector<CollapseLink> links(count);
    std::vector<uint32_t> numbers(count);
    std::iota(numbers.begin(), numbers.end(), 0u);
    // Children lie before their parents.
    for (uint32_t i = 0; i < count; ++i) {
        CollapseLink& link = links[i];
        const uint32_t place = count - 1 - i;  // from the root
        const auto child = [&](uint32_t c) { return c < count ? count - 1 - c : kNoOperation; };
        link.child = {kNoOperation, kNoOperation};
        if (shape == Shape::kTree) link.child = {child(2 * place + 1), child(2 * place + 2)};
        if (shape == Shape::kChain) link.child[0] = child(place + 1);
        link.u = i;
        link.error = float(i);
        link.box.add(Vec3i(int32_t(uint64_t(i) * 7919 % count), int32_t(i % 64), 0));
        for (const uint32_t c : link.child) {
            if (c == kNoOperation) continue;
            link.operations += links[c].operations;
            link.box.add(links[c].box);
        }
        const CollapseRecord record{};
        out.store.append({&link, 1}, {&record, 1}, numbers);
        if (shape == Shape::kLoose || place == 0) out.base_last.push_back(i);
    }
}

TEST(NodePacker, FillsWhateverTheShape) {
    Budget budget(size_t(1) << 28);
    TempSpace space{testing::TempDir(), &budget, 0};
    for (const uint32_t count : {0u, 1u, 681u, 682u, 683u, 1364u, 1365u, 20000u})
        for (const Shape shape : {Shape::kTree, Shape::kChain, Shape::kLoose}) {
            Collapses collapses(space);
            makeCollapses(count, shape, collapses);
            Packing packing(space);
            std::set<OperationId> ids;
            packCollapses(collapses, packing, [&](VertexId, OperationId o) { ids.insert(o); });
            EXPECT_EQ(ids.size(), count);
            uint32_t sum = 0;
            for (NodeIndex n = 0; n < packing.size(); ++n) {
                const PackedNode node = packing.node(n);
                const NodeRow& row = node.row;
                EXPECT_LE(row.operations, kNodeSlots);
                EXPECT_TRUE(row.operations > 0 || count == 0);
                EXPECT_EQ(node.slot.size(), row.operations);
                EXPECT_TRUE(shape != Shape::kLoose || row.parent == kNoNode);
                sum += row.operations;
            }
            EXPECT_EQ(sum, count);
            EXPECT_LE(packing.size(), 1 + count / (kNodeSlots * 9 / 10)) << count;
        }
}

TEST(StructureWord, KeepsCodesAtTheirBorders) {
    for (const uint32_t a : {0u, 681u, 682u, 1363u, 1364u, 2045u, 2046u, 2047u})
        for (const uint32_t b : {0u, 681u, 682u, 1363u, 1364u, 2045u, 2046u, 2047u})
            for (const uint32_t level : {0u, 1u, 1022u, 1023u}) {
                const StructureWord word = StructureWord::of(a, b, level);
                EXPECT_EQ(word.child(0), a);
                EXPECT_EQ(word.child(1), b);
                EXPECT_EQ(word.level(), level);
            }
    NodeRow row;
    row.child = {7, 9};
    const auto childOf = [&](ChildCode code) {
        NodeOperation o;
        o.structure = StructureWord::of(code, kNoChildCode, 0);
        return childId(5, row, o, 0);
    };
    EXPECT_EQ(childOf(681), operationId(5, 681));
    EXPECT_EQ(childOf(682), operationId(7, 0));
    EXPECT_EQ(childOf(1363), operationId(7, 681));
    EXPECT_EQ(childOf(1364), operationId(9, 0));
    EXPECT_EQ(childOf(2045), operationId(9, 681));
    EXPECT_EQ(childOf(2046), kNoOperation);
    EXPECT_EQ(childOf(2047), kNoOperation);
}

TEST(DamagedNode, IsRefusedWithAMessage) {
    const Built built = buildFor(onLattice(dented(test::sphereShape(24), 0.01), 900));
    const NodeForest& whole = built.forest;
    ASSERT_GT(whole.node.size(), 3u);
    const auto expect = [&](const std::string& message, const auto& damage) {
        OperationNode node = whole.node[0];
        damage(node);
        EXPECT_EQ(faultOf(0, whole.row[0], node), message);
    };
    const auto setLevel = [](NodeOperation& o, uint32_t level) {
        o.structure = StructureWord::of(o.structure.child(0), o.structure.child(1), level);
    };
    const auto setChild = [](NodeOperation& o, ChildCode code) {
        o.structure = StructureWord::of(code, o.structure.child(1), o.structure.level());
    };
    using Node = OperationNode;
    expect("", [](Node&) {});
    expect("it has 681 operations", [](Node& n) { n.operation.pop_back(); });
    expect("operation 3: its level is 1023, the largest is 1022",
           [&](Node& n) { setLevel(n.operation[3], 1023); });
    expect("operation 5: its neighbours have equal ranks",
           [](Node& n) { n.operation[5].ranks = 0x33; });
    expect("operation 7: its error has the code 0", [](Node& n) { n.operation[7].error = 0; });
    expect("operation 0: its error exceeds its node's",
           [](Node& n) { n.operation[0].error = 255; });
    expect("operation 0: its children are not the next ones",
           [&](Node& n) { setChild(n.operation[0], 681); });
    expect(fmt::format("it refers to {0} operations of child 1, and has {1} levels",
                       whole.node[0].reference_level[1].size(),
                       whole.node[0].reference_level[1].size() + 1),
           [](Node& n) { n.reference_level[1].push_back(1000); });
    expect("operation 0: its level is not below its child's",
           [&](Node& n) { setLevel(n.operation[0], 1000); });

    OperationNode child = whole.node[1];
    setLevel(child.operation[2], child.operation[2].structure.level() - 1);
    EXPECT_EQ(faultBetween(whole.row[0], whole.node[0], 1, child),
              "operation 2: its level is not the one its parent knows");
    child = whole.node[1];
    child.operation[4].error = 255;
    EXPECT_EQ(faultBetween(whole.row[0], whole.node[0], 1, child),
              "operation 4: its criteria exceed its parent's");
}

/// What is accepted keeps its rules, whatever the bytes.
TEST(DamagedNode, IsRefusedOrSound) {
    const Built built = buildFor(onLattice(dented(test::sphereShape(24), 0.01), 900));
    const NodeForest& forest = built.forest;
    std::mt19937 random(21);
    std::string fault;
    uint32_t refused = 0;
    for (int i = 0; i < 3000; ++i) {
        const NodeIndex n = NodeIndex(random() % forest.node.size());
        std::vector<std::byte> bytes = encodeNode(forest.node[n]);
        if (random() % 4 == 0) bytes.resize(random() % bytes.size());
        for (uint32_t k = random() % 4; k > 0 && !bytes.empty(); --k)
            bytes[random() % std::min<size_t>(bytes.size(), random() % 2 ? 100 : 20000)] =
                std::byte(random());
        OperationNode node;
        if (!decodeNode(bytes, n, forest.row[n], forest.layout, node, fault)) {
            EXPECT_NE(fault, "");
            ++refused;
            continue;
        }
        EXPECT_EQ(faultOf(n, forest.row[n], node), "");
        bytes = encodeBase(forest);
        bytes[random() % bytes.size()] = std::byte(random());
        NodeForest base;
        base.row = forest.row;
        if (decodeBase(bytes, kMethodFormat, base, fault)) {
            EXPECT_EQ(base.base_operation.size(), base.base_vertex.size());
        }
    }
    EXPECT_GT(refused, 1000u);
}

}  // namespace
}  // namespace pietra::pmesh
