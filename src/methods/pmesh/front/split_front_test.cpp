// The active vertices by leaves, out of core, against collapses done one by one on the input.

#include "methods/pmesh/front/split_front.h"

#include <numeric>
#include <random>

#include "methods/pmesh/collapse_log.h"
#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

// Of larger meshes only some views are compared: that takes most of the time.
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
constexpr size_t kSmall = 300, kSome = 16;
#else
constexpr size_t kSmall = 3000, kSome = 4;
#endif

/// In core, or by diamonds of so few triangles.
struct ForestMesh {
    TestMesh mesh;
    uint32_t leaf_triangles = 0;
    std::string name() const {
        return leaf_triangles > 0 ? std::string(mesh.name) + "_by_diamonds" : mesh.name;
    }
};

std::vector<ForestMesh> meshes() {
    std::vector<TestMesh> all = testMeshes();
    all.push_back({"sheet", [] { return onLattice(test::gridShape(90, 0.1), 5000); }});
    all.push_back(
        {"large_ball", [] { return onLattice(dented(test::sphereShape(64), 0.01), 1 << 20); }});
    std::vector<ForestMesh> both;
    for (const TestMesh& mesh : all)
        for (const uint32_t leaf_triangles : {0u, 100u}) both.push_back({mesh, leaf_triangles});
    return both;
}

struct Made {
    explicit Made(const Mesh& mesh, uint32_t leaf_triangles = 0) {
        if (leaf_triangles > 0) {
            DiamondLog made = logDiamonds(mesh, leaf_triangles);
            log = std::move(made.log);
            forest = std::move(made.forest);
            leaf_of.resize(log.input.vertexCount());
            std::iota(leaf_of.begin(), leaf_of.end(), Leaf(0));
        } else {
            Budget budget(size_t(1) << 30);
            log = logCollapses(mesh, Lattice{}, budget);
            BuildCounts counts;
            counts.leaf_of.resize(mesh.vertexCount());
            forest = buildInCore(mesh, Lattice{}, budget, &counts);
            leaf_of = counts.leaf_of;
        }
        // A collapse has the name of u's first leaf.
        for (const CollapseLog::Collapse& c : log.collapse) name.push_back(leaf_of[c.u]);
        size_t leaves = 0;
        for (const SplitBase::Root& root : forest.base.root) leaves += root.leaves;
        EXPECT_EQ(leaves, log.collapse.size() + forest.base.root.size());
        criterion.resize(leaves);
        // Nodes one by one, as they would arrive.
        const ResidentSplits nodes = all();
        for (const SplitBase::Root& root : forest.base.root)
            if (root.split != kNoSplit)
                criterion[nodes.at(root.split).name] = nodes.rootCriterion(root.split);
        for (NodeIndex n = 0; n < forest.row.size(); ++n)
            for (uint32_t s = 0; s < forest.node[n].split.size(); ++s) {
                const ResidentSplit& split = nodes.at(splitId(n, s));
                const std::array<SplitId, 2> child = nodes.childrenOf(splitId(n, s), split);
                for (const size_t end : {0u, 1u})
                    if (child[end] != kNoSplit)
                        criterion[nodes.at(child[end]).name] = split.criterion[end];
            }
    }
    ResidentSplits all() const {
        ResidentSplits nodes(roots(), ~0u);
        for (NodeIndex n = 0; n < forest.row.size(); ++n)
            if (forest.row[n].parent != kNoNode) {
                EXPECT_TRUE(nodes.arrive(n, forest.node[n]));
            }
        return nodes;
    }
    /// With roots only.
    SplitForest roots() const {
        SplitForest some = forest;
        for (size_t n = 0; n < some.row.size(); ++n)
            if (some.row[n].parent != kNoNode) some.node[n] = {};
        return some;
    }
    CollapseLog log;
    std::vector<Leaf> leaf_of, name;
    std::vector<NestedCriterion> criterion;  ///< by name
    SplitForest forest;
};

/// A mesh with names: first leaves.
struct Named {
    std::map<Leaf, SplitVertex> vertex;
    std::vector<std::array<Leaf, 3>> triangle;
    void add(std::array<Leaf, 3> t) {
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        triangle.push_back(t);
    }
    bool operator==(const Named& other) const {
        if (triangle != other.triangle || vertex.size() != other.vertex.size()) return false;
        return std::equal(vertex.begin(), vertex.end(), other.vertex.begin());
    }
};

Named namedOf(const SplitFront& front, const SplitForest& forest) {
    Named named;
    const auto name = [&](Leaf leaf) {
        return front.blocks().firstLeaf(front.blocks().ownerOf(leaf));
    };
    for (uint32_t b = 0; b < front.blocks().all().size(); ++b) {
        Leaf last = 0;
        for (uint32_t r = 0; r < front.blocks().countOf(b); ++r) {
            const Leaf first = front.blocks().firstLeaf({b, r});
            EXPECT_EQ(front.blocks().ownerOf(first), (SplitBlocks::Place{b, r}));
            EXPECT_TRUE(r == 0 || first > last);
            last = first;
            const SplitBlocks::Slot slot = front.blocks().at({b, r});
            EXPECT_EQ(slot.page.first[slot.i], first);
            EXPECT_TRUE(named.vertex.emplace(first, slot.page.vertex[slot.i]).second);
            const auto& leaf = slot.page.leaf[slot.i];
            for (size_t t = 0; t < 6; t += 3)
                if (leaf[t] != leaf[t + 1])
                    named.add({name(leaf[t]), name(leaf[t + 1]), name(leaf[t + 2])});
        }
    }
    for (const auto& t : forest.base.triangle) named.add({name(t[0]), name(t[1]), name(t[2])});
    std::sort(named.triangle.begin(), named.triangle.end());
    EXPECT_EQ(named.vertex.size(), front.vertexCount());
    EXPECT_EQ(named.triangle.size(), front.triangleCount());
    return named;
}

/// All collapses but some, in their order. Each must find the very star that it had when everything
/// was collapsed.
Named collapsed(const Made& made, const std::vector<bool>& undone) {
    const Mesh& input = made.log.input;
    std::map<uint32_t, SplitVertex> now;
    for (uint32_t v = 0; v < input.vertexCount(); ++v)
        now[v] = {input.position[v], packNormal(input.normal[v])};
    Replay replay(input);
    for (size_t i = 0; i < made.log.collapse.size(); ++i) {
        const CollapseLog::Collapse& c = made.log.collapse[i];
        if (undone[i]) continue;
        EXPECT_EQ(now[c.v], c.before[0]);
        EXPECT_EQ(now[c.u], c.before[1]);
        EXPECT_EQ(replay.ring(c.v, c.u), c.neighbour);
        EXPECT_EQ(replay.wings(c.v, c.u), c.triangle);
        replay.collapse(c.v, c.u);
        now.erase(c.u);
        now[c.v] = c.after;
    }
    Named named;
    for (const auto& [v, vertex] : now) named.vertex[made.leaf_of[v]] = vertex;
    for (const Triangle& t : replay.triangles())
        named.add({made.leaf_of[t[0]], made.leaf_of[t[1]], made.leaf_of[t[2]]});
    std::sort(named.triangle.begin(), named.triangle.end());
    return named;
}

std::vector<bool> neededBy(const Made& made, const SplitView& view) {
    std::vector<bool> needed;
    for (const Leaf name : made.name) needed.push_back(view.needs(made.criterion[name]));
    return needed;
}

/// The splits that are applied.
std::vector<bool> appliedIn(const Made& made, const SplitFront& front) {
    std::vector<bool> applied;
    for (const Leaf name : made.name) {
        const SplitBlocks::Place p = front.blocks().ownerOf(name);
        applied.push_back(front.blocks().firstLeaf(p) == name);
    }
    return applied;
}

class EachForest : public testing::TestWithParam<ForestMesh> {};
INSTANTIATE_TEST_SUITE_P(SplitFront, EachForest, testing::ValuesIn(meshes()),
                         [](const auto& test) { return test.param.name(); });

TEST_P(EachForest, EveryViewIsTheInputWithWhatItDoesNotNeedCollapsed) {
    const Made made(GetParam().mesh.make(), GetParam().leaf_triangles);
    ResidentSplits nodes = made.all();
    std::mt19937 random(5);
    std::vector<SplitView> views{wholeSplitView(true), wholeSplitView(false), wholeSplitView(true)};
    for (int i = 0; i < 20; ++i) views.push_back(randomView(random, made.forest));
    views.push_back(wholeSplitView(false));
    SplitView slow = randomView(random, made.forest);
    for (slow.reach = 0.5f; slow.reach < 8000; slow.reach *= 1.15f) views.push_back(slow);
    for (int i = 0; i < 20; ++i) {
        slow.eye[0] += 3;
        views.push_back(slow);
    }
    SplitFront front(nodes);
    uint32_t before = 0, mixed = 0, looked = 0;
    for (const SplitView& view : views) {
        nodes.look(view);
        EXPECT_EQ(nodes.missing(), 0u);
        const SplitCounts counts = front.adapt(view);
        const std::vector<bool> needed = neededBy(made, view);
        const auto undone = uint32_t(std::count(needed.begin(), needed.end(), true));
        if (made.log.collapse.size() < kSmall || ++looked % kSome == 0) {
            EXPECT_TRUE(namedOf(front, made.forest) == collapsed(made, needed));
        }
        EXPECT_EQ(before + counts.splits - counts.merges, undone);
        mixed += undone > 0 && undone < made.log.collapse.size();
        before = undone;
        EXPECT_EQ(front.toDo(view), 0u);
        EXPECT_EQ(front.adapt(view).operations(), 0u);
        if (HasFailure()) return;
    }
    EXPECT_TRUE(mixed > 5 || made.log.collapse.size() < 100);
}

/// Nodes come late, in any order, and leave; the mesh is one that collapses reach, and once all has
/// come, the one that is needed. Limits hold.
TEST_P(EachForest, WhateverIsThereEveryFrameIsOneMesh) {
    const Made made(GetParam().mesh.make(), GetParam().leaf_triangles);
    std::mt19937 random(11);
    uint32_t waited = 0, limited = 0;
    for (const uint32_t most : {~0u, 12u}) {
        ResidentSplits nodes(made.roots(), uint32_t(made.forest.row.size()));
        nodes.setMost(most);
        SplitFront front(nodes);
        SplitView view = randomView(random, made.forest);
        for (int frame = 0; frame < 120; ++frame) {
            if (frame % 20 == 0) view = randomView(random, made.forest);
            if (frame % 20 < 5) view.eye[1] += 50;
            nodes.look(view);
            SplitLimits limits;
            if (frame / 20 % 3 == 1) limits.splits = 60;
            if (frame / 20 % 3 == 2) limits.vertices = made.forest.base.root.size() + 300;
            const size_t vertices = front.vertexCount();
            const SplitCounts counts = front.adapt(view, limits);
            EXPECT_LE(front.vertexCount(), std::max(vertices, limits.vertices));
            // What the eye is in the boxes of is needed at any tolerance, all or nothing.
            EXPECT_LE(counts.splits, std::max<size_t>(limits.splits, 500));
            limited += counts.short_of_splits || counts.short_of_vertices;
            const std::vector<bool> applied = appliedIn(made, front);
            if (made.log.collapse.size() < kSmall || frame % (2 * kSome) == 3) {
                EXPECT_TRUE(namedOf(front, made.forest) == collapsed(made, applied));
            }
            const std::vector<bool> needed = neededBy(made, view);
            for (size_t i = 0; i < applied.size(); ++i) EXPECT_LE(applied[i], needed[i]);
            waited += nodes.missing() > 0;
            if (nodes.missing() == 0 && !counts.short_of_splits && !counts.short_of_vertices) {
                EXPECT_EQ(applied, needed);
            }
            if (HasFailure()) return;
            std::vector<NodeIndex> asked = nodes.requests(1 + random() % 4);
            std::shuffle(asked.begin(), asked.end(), random);
            for (const NodeIndex n : asked)
                if (const auto arrived = nodes.arrive(n, made.forest.node[n]))
                    front.arrived(*arrived);
            EXPECT_LE(nodes.loaded(), std::max<size_t>(most, 1));
            if (random() % 8 == 0) nodes.evictOldest();
        }
    }
    EXPECT_TRUE(made.log.collapse.size() < 4000 || (waited > 10 && limited > 0));
}

/// Renderers without room rely on it (runtime/scene_meshes).
TEST(SplitFront, AtTheCoarsestToleranceNothingIsLeftWhereverTheEyeIs) {
    const Made made(onLattice(dented(test::sphereShape(40), 0.01), 1 << 20));
    ResidentSplits nodes = made.all();
    SplitFront front(nodes);
    const SplitGrid& grid = made.forest.grid;
    Camera camera;
    camera.eye = Lattice{}.toInput(made.log.input.position[0]);
    camera.target = camera.eye + Vec3d(1, 0, 0);
    const auto adapt = [&](double pixels) {
        const SplitView view =
            splitView(View(camera, {640, 480}, Lattice{}), Lattice{}, grid, pixels);
        nodes.look(view);
        front.adapt(view);
        return front.vertexCount();
    };
    const size_t roots = made.forest.base.root.size();
    EXPECT_GT(adapt(1e9), roots);
    EXPECT_EQ(adapt(1e36), roots);
}

TEST(SplitFront, TheNumberOfThreadsDoesNotShow) {
    const Made made(onLattice(dented(test::sphereShape(80), 0.01), 1 << 20));
    std::vector<std::vector<std::byte>> memory;
    for (const int jobs : {1, 2, 7}) {
        const ThreadLimit limit(jobs);
        ResidentSplits nodes = made.all();
        SplitFront front(nodes);
        std::mt19937 random(9);
        std::vector<std::byte>& bytes = memory.emplace_back();
        for (int i = 0; i < 20; ++i) {
            const SplitView view = randomView(random, made.forest);
            nodes.look(view);
            front.adapt(view);
            for (uint32_t b = 0; b < front.blocks().all().size(); ++b)
                for (uint32_t r = 0; r < front.blocks().countOf(b); ++r) {
                    const SplitBlocks::Slot slot = front.blocks().at({b, r});
                    const std::array<uint32_t, 3> some{b, slot.i, slot.page.first[slot.i]};
                    const auto all = std::as_bytes(std::span(some));
                    bytes.insert(bytes.end(), all.begin(), all.end());
                }
        }
    }
    EXPECT_TRUE(memory[0] == memory[1]);
    EXPECT_TRUE(memory[0] == memory[2]);
}

}  // namespace
}  // namespace pietra::pmesh
