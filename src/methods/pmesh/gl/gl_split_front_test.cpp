// The active vertices on the GPU are those of the CPU, to the bit, frame by frame.

#include "methods/pmesh/gl/gl_split_front.h"

#include "gpu/test_context.h"
#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

/// In the order of leaves.
template <class Visit>
void forVertices(const SplitFront& front, Visit&& visit) {
    const SplitBlocks& blocks = front.blocks();
    for (uint32_t b = 0; b != SplitBlocks::kNone; b = blocks.all()[b].next)
        for (uint32_t r = 0; r < blocks.countOf(b); ++r) visit(SplitBlocks::Place{b, r});
}

std::vector<ActiveVertex> verticesOf(const SplitFront& front) {
    std::vector<ActiveVertex> vertices;
    forVertices(front, [&](SplitBlocks::Place place) {
        const auto [p, i] = front.blocks().at(place);
        const bool is_closed = (p.closed >> i & 1) != 0;
        vertices.push_back({p.birth.get(i), p.next.get(i), p.first[i], p.last[i], p.parent[i],
                            p.split[i], p.made[i], p.vertex[i], p.merged[i], p.leaf[i], is_closed});
        if (p.made[i] == kNoSplit) vertices.back().merged = {};
    });
    return vertices;
}

std::vector<uint32_t> wordsOf(const SplitFront& front) {
    std::vector<uint32_t> words;
    forVertices(front, [&](SplitBlocks::Place place) {
        const uint32_t* const of_vertex = front.blocks().wordsOf(place);
        words.insert(words.end(), of_vertex, of_vertex + front.blocks().wordsAVertex());
    });
    return words;
}

class GlSplits : public GlTest, public testing::WithParamInterface<TestMesh> {
protected:
    /// Nodes come late and leave, unless all are there from the start.
    void compare(Mesh mesh, uint32_t most, uint32_t groups) {
        Budget budget(size_t(1) << 30);
        SplitForest forest = buildInCore(std::move(mesh), Lattice{}, budget);
        const std::vector<SplitNode> node = forest.node;
        ResidentSplits nodes(forest, uint32_t(node.size()));
        nodes.setMost(most);
        SplitFront cpu(nodes);
        GlSplitFront gl(nodes, uint32_t(std::min<size_t>(most, node.size())), groups);
        std::mt19937 random(17);
        SplitView view;
        uint32_t operations = 0;
        for (int frame = 0; frame < 80 && !HasFailure(); ++frame) {
            if (frame % 12 == 0) view = randomView(random, forest);
            if (frame % 12 == 7) view.eye[1] += 50;
            if (frame % 30 == 20) view = wholeSplitView(true);
            if (frame % 30 == 25) view = wholeSplitView(false);
            nodes.look(view);
            const SplitCounts counts = cpu.adapt(view), of_gl = gl.adapt(view);
            EXPECT_EQ(counts.splits, of_gl.splits);
            EXPECT_EQ(counts.merges, of_gl.merges);
            EXPECT_EQ(cpu.triangleCount(), gl.triangleCount());
            ASSERT_EQ(cpu.vertexCount(), gl.vertexCount());
            const std::vector<ActiveVertex> expected = verticesOf(cpu);
            std::vector<ActiveVertex> found = gl.download();
            for (ActiveVertex& v : found)
                if (v.made == kNoSplit) v.merged = {};
            for (size_t i = 0; i < expected.size(); ++i)
                ASSERT_TRUE(expected[i] == found[i]) << "frame " << frame << ", vertex " << i;
            EXPECT_EQ(wordsOf(cpu), gl.downloadWords());
            operations += counts.operations();
            for (const NodeIndex n : nodes.requests(3)) {
                const auto arrived = nodes.arrive(n, node[n]);
                if (!arrived) continue;
                cpu.arrived(*arrived);
                gl.arrived(*arrived);
            }
            if (random() % 4 == 0) nodes.evictOldest();
        }
        EXPECT_TRUE(operations > 500 || node.size() < 2) << operations;
    }
};
std::vector<TestMesh> meshes() {
    std::vector<TestMesh> meshes = testMeshes();
    // More leaves than one group counts, and more nodes than there is room for.
    meshes.push_back(
        {"large_ball", [] { return onLattice(dented(test::sphereShape(80), 0.01), 1 << 20); }});
    return meshes;
}
INSTANTIATE_TEST_SUITE_P(Pmesh, GlSplits, testing::ValuesIn(meshes()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(GlSplits, HaveTheVerticesOfTheCpuAfterEachFrame) {
    compare(GetParam().make(), ~0u, 8);
    compare(GetParam().make(), 12, 3);
}

TEST_P(GlSplits, CarryWords) {
    Mesh mesh = GetParam().make();
    std::mt19937 random(3);
    for (size_t v = 0; v < mesh.vertexCount(); ++v)
        mesh.colour.push_back(std::bit_cast<Rgba8>(uint32_t(random())));
    compare(std::move(mesh), ~0u, 8);
}

}  // namespace
}  // namespace pietra::pmesh
