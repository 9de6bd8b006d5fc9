// The active vertices by leaves, against collapses done one by one on the input.

#include "methods/pmesh/front/leaf_front.h"

#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

std::vector<TestMesh> meshes() {
    std::vector<TestMesh> all = testMeshes();
    // Several blocks.
    all.push_back({"sheet", [] { return onLattice(test::gridShape(90, 0.1), 5000); }});
    all.push_back({"large_ball", [] {
                       return onLattice(dented(test::sphereShape(32), 0.01), 1 << 20);
                   }});
    return all;
}

struct Made {
    explicit Made(const Mesh& mesh) {
        Budget budget(size_t(1) << 30);
        log = logCollapses(mesh, Lattice{}, budget);
        forest = makeLeafForest(log, &leaf_of);
        // A collapse has the name of u's first leaf.
        std::vector<Leaf> first = leaf_of;
        for (const CollapseLog::Collapse& c : log.collapse) {
            name.push_back(first[c.u]);
            EXPECT_LT(first[c.v], first[c.u]);
        }
        criterion.resize(forest.leaves());
        for (const LeafRoot& root : forest.root)
            if (root.split != kNoLeaf) criterion[root.split] = root.criterion;
        for (const Leaf n : name)
            for (const size_t end : {0u, 1u})
                if (forest.split[n].child[end] != kNoLeaf)
                    criterion[forest.split[n].child[end]] = forest.split[n].criterion[end];
    }
    CollapseLog log;
    LeafForest forest;
    std::vector<Leaf> leaf_of, name;
    std::vector<NestedCriterion> criterion;  ///< by name
};

/// The rule once more.
bool needs(const FrontView& view, const NestedCriterion& c) {
    float squared = 0, inside = 0;
    for (size_t k = 0; k < 3; ++k) {
        const float d = std::max(
            {float(c.min[k]) - view.eye[k], view.eye[k] - float(c.max[k]), 0.0f});
        squared += d * d;
    }
    for (size_t i = 0; i < 4; ++i) {
        float depth = -view.at_eye[i];
        for (size_t k = 0; k < 3; ++k)
            depth += float(view.side[i][k] > 0 ? c.max[k] : c.min[k]) * view.side[i][k];
        inside = std::min(inside, depth);
    }
    const float rest = std::bit_cast<float>(uint32_t(c.error) << 16) * view.reach +
                       inside * FrontView::kOutside;
    return rest > 0 && rest * rest > squared;
}

FrontView randomFrontView(std::mt19937& random, const LeafForest& forest) {
    const NestedCriterion& c = forest.root.front().criterion;
    const Vec3d size(c.max[0], c.max[1], c.max[2]);
    std::uniform_real_distribution<float> place(-0.5f, 1.5f), power(-3, 12);
    std::normal_distribution<float> any;
    FrontView view;
    for (int k = 0; k < 3; ++k) view.eye[size_t(k)] = place(random) * float(size[k]);
    view.reach = std::exp2(power(random));
    if (random() % 2 == 0) return view;
    for (size_t i = 0; i < 4; ++i) {
        const Vec3f n = glm::normalize(Vec3f(any(random), any(random), any(random)));
        for (int k = 0; k < 3; ++k) {
            view.side[i][size_t(k)] = n[k];
            view.at_eye[i] += n[k] * view.eye[size_t(k)];
        }
    }
    return view;
}

/// A mesh with names: first leaves.
struct Named {
    std::map<Leaf, Vertex> vertex;
    std::vector<std::array<Leaf, 3>> triangle;
    void add(std::array<Leaf, 3> t) {
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        triangle.push_back(t);
    }
    bool operator==(const Named&) const = default;
};

Named namedOf(const LeafFront& front) {
    Named named;
    front.forEachPage([&](const FrontPage& page, uint32_t) {
        for (uint32_t s = 0; s < kPageSlots; ++s) {
            if ((page.alive >> s & 1) == 0) continue;
            EXPECT_TRUE(named.vertex.emplace(page.first[s], page.vertex[s]).second);
            for (size_t t = 0; t < 6; t += 3) {
                const auto* corner = &page.corner[s][t];
                if (page.leaf[s][t] != page.leaf[s][t + 1])
                    named.add({front.firstLeaf(corner[0]), front.firstLeaf(corner[1]),
                               front.firstLeaf(corner[2])});
            }
        }
    });
    const std::vector<uint32_t>& base = front.baseCorners();
    for (size_t i = 0; i + 2 < base.size(); i += 3)
        if (base[i] != base[i + 1])
            named.add({front.firstLeaf(base[i]), front.firstLeaf(base[i + 1]),
                       front.firstLeaf(base[i + 2])});
    std::sort(named.triangle.begin(), named.triangle.end());
    EXPECT_EQ(named.vertex.size(), front.vertexCount());
    EXPECT_EQ(named.triangle.size(), front.triangleCount());
    return named;
}

/// All collapses that are not needed, in their order. Each must find the very star that it had when
/// everything was collapsed.
Named collapsed(const Made& made, const FrontView& view, uint32_t& undone) {
    const size_t count = made.log.vertex.size();
    std::vector<uint32_t> into(count);
    for (uint32_t v = 0; v < count; ++v) into[v] = v;
    std::vector<Vertex> now = made.log.vertex;
    std::vector<Triangle> triangle = made.log.triangle;
    std::vector<std::set<uint32_t>> around(count);
    for (uint32_t t = 0; t < triangle.size(); ++t)
        for (const uint32_t v : triangle[t]) around[v].insert(t);
    undone = 0;
    for (size_t i = 0; i < made.log.collapse.size(); ++i) {
        const CollapseLog::Collapse& c = made.log.collapse[i];
        if (needs(view, made.criterion[made.name[i]])) {
            ++undone;
            continue;
        }
        EXPECT_EQ(now[c.v], c.before[0]);
        EXPECT_EQ(now[c.u], c.before[1]);
        std::set<uint32_t> ring, gone;
        for (const uint32_t end : {c.v, c.u})
            for (const uint32_t t : around[end])
                for (const uint32_t w : triangle[t]) {
                    if (w != c.v && w != c.u) ring.insert(w);
                    if (w != end && (w == c.v || w == c.u)) gone.insert(t);
                }
        EXPECT_EQ(ring, std::set<uint32_t>(c.neighbour.begin(), c.neighbour.begin() +
                                                                    c.neighbours));
        EXPECT_EQ(gone,
                  std::set<uint32_t>(c.triangle.begin(), c.triangle.begin() + c.triangles));
        for (const uint32_t t : gone)
            for (const uint32_t w : triangle[t]) around[w].erase(t);
        for (const uint32_t t : around[c.u]) {
            for (uint32_t& w : triangle[t])
                if (w == c.u) w = c.v;
            around[c.v].insert(t);
        }
        around[c.u].clear();
        into[c.u] = c.v;
        now[c.v] = c.after;
    }
    Named named;
    std::vector<Leaf> first(count, kNoLeaf);
    const auto root = [&](uint32_t v) {
        while (into[v] != v) v = into[v];
        return v;
    };
    for (uint32_t v = 0; v < count; ++v) {
        Leaf& f = first[root(v)];
        f = std::min(f, made.leaf_of[v]);
    }
    for (uint32_t v = 0; v < count; ++v)
        if (into[v] == v) named.vertex[first[v]] = now[v];
    std::set<uint32_t> left;
    for (const auto& a : around) left.insert(a.begin(), a.end());
    for (const uint32_t t : left)
        named.add({first[triangle[t][0]], first[triangle[t][1]], first[triangle[t][2]]});
    std::sort(named.triangle.begin(), named.triangle.end());
    return named;
}

class EachMesh : public testing::TestWithParam<TestMesh> {};
INSTANTIATE_TEST_SUITE_P(Front, EachMesh, testing::ValuesIn(meshes()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(EachMesh, CriteriaNestAlongDependencies) {
    const Made made(GetParam().make());
    std::vector<std::vector<Leaf>> waiting(made.log.vertex.size());  // for a vertex's next collapse
    for (size_t i = 0; i < made.log.collapse.size(); ++i) {
        const CollapseLog::Collapse& c = made.log.collapse[i];
        for (const uint32_t end : {c.v, c.u}) {
            for (const Leaf below : waiting[end])
                EXPECT_TRUE(made.criterion[made.name[i]].encloses(made.criterion[below]));
            waiting[end].clear();
        }
        waiting[c.v].push_back(made.name[i]);
        for (uint8_t k = 0; k < c.neighbours; ++k)
            waiting[c.neighbour[k]].push_back(made.name[i]);
    }
}

TEST_P(EachMesh, EveryViewIsTheInputWithWhatItDoesNotNeedCollapsed) {
    const Made made(GetParam().make());
    LeafFront front(made.forest);
    std::mt19937 random(5);
    std::vector<FrontView> views{wholeView(true), wholeView(false), wholeView(true)};
    for (int i = 0; i < 20; ++i) views.push_back(randomFrontView(random, made.forest));
    views.push_back(wholeView(false));
    // Few changes a frame: most blocks have none.
    FrontView slow = randomFrontView(random, made.forest);
    for (slow.reach = 0.5f; slow.reach < 8000; slow.reach *= 1.15f) views.push_back(slow);
    for (int i = 0; i < 20; ++i) {
        slow.eye[0] += 3;
        views.push_back(slow);
    }
    uint32_t before = 0, mixed = 0;
    for (const FrontView& view : views) {
        const FrontCounts counts = front.adapt(view);
        uint32_t undone = 0;
        const Named expected = collapsed(made, view, undone);
        EXPECT_EQ(namedOf(front), expected);
        EXPECT_EQ(before + counts.splits - counts.merges, undone);
        mixed += undone > 0 && undone < made.log.collapse.size();
        before = undone;
        EXPECT_EQ(front.adapt(view).operations(), 0u);
        if (HasFailure()) return;
    }
    EXPECT_TRUE(mixed > 5 || made.log.collapse.size() < 100);
}

TEST(LeafFront, WhatChangesIsLookedUpWhereverItLies) {
    const Made made(onLattice(dented(test::sphereShape(64), 0.01), 1 << 20));
    ASSERT_GT(made.forest.leaves(), 8 * kBlockLeaves);
    LeafFront front(made.forest);
    std::mt19937 random(3);
    for (int flight = 0; flight < 2; ++flight) {
        FrontView view = randomFrontView(random, made.forest);
        for (view.reach = 0.3f; view.reach < 300; view.reach *= 1.1f) {
            front.adapt(view);
            LeafFront fresh(made.forest);
            fresh.adapt(view);
            ASSERT_TRUE(namedOf(front) == namedOf(fresh));
        }
    }
}

TEST(LeafFront, TheNumberOfThreadsDoesNotShow) {
    const Made made(onLattice(dented(test::sphereShape(64), 0.01), 1 << 20));
    ASSERT_GT(made.forest.leaves(), 8 * kBlockLeaves);
    std::vector<std::vector<std::byte>> memory;
    for (const int jobs : {1, 2, 7}) {
        const ThreadLimit limit(jobs);
        LeafFront front(made.forest);
        std::mt19937 random(9);
        std::vector<std::byte>& bytes = memory.emplace_back();
        for (int i = 0; i < 20; ++i) {
            front.adapt(randomFrontView(random, made.forest));
            front.forEachPage([&](const FrontPage& page, uint32_t) {
                const auto all = std::as_bytes(std::span(&page, 1));
                bytes.insert(bytes.end(), all.begin(), all.end());
            });
        }
    }
    EXPECT_EQ(memory[0].size(), memory[1].size());
    EXPECT_TRUE(memory[0] == memory[1]);
    EXPECT_TRUE(memory[0] == memory[2]);
}

}  // namespace
}  // namespace pietra::pmesh
