#include "multires/cut.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

#include "multires/forest.h"
#include "multires/toy_terrain.h"

namespace pietra {
namespace {

std::vector<ToyTerrain> someTerrains() {
    std::vector<ToyTerrain> terrains;
    for (uint64_t seed = 1; seed <= 6; ++seed) {
        ToyTerrainSettings settings;
        settings.seed = seed;
        settings.depth = 4 + int(seed);
        settings.keep_refining = 0.3 + 0.1 * double(seed);
        terrains.push_back(makeToyTerrain(settings));
    }
    return terrains;
}

uint64_t trianglesOf(const std::vector<Node>& nodes, const Cut& cut) {
    uint64_t sum = 0;
    for (const NodeIndex i : cut.nodes) sum += nodes[i].triangles;
    return sum;
}

float errorOf(const std::vector<Node>& nodes, const Cut& cut) {
    float error = 0;
    for (const NodeIndex i : cut.nodes) error = std::max(error, nodes[i].error);
    return error;
}

void expectConsistent(const std::vector<Node>& nodes, const Cut& cut) {
    EXPECT_EQ(validateCut(nodes, cut.nodes), "");
    EXPECT_TRUE(std::is_sorted(cut.nodes.begin(), cut.nodes.end()));
    EXPECT_EQ(cut.triangles, trianglesOf(nodes, cut));
    EXPECT_EQ(cut.max_error, errorOf(nodes, cut));
}

/// Every edge, by its end points, with the number of its uses in the cut.
std::map<std::array<uint64_t, 2>, int> edgesOf(const ToyTerrain& model, const Cut& cut) {
    std::map<std::array<uint64_t, 2>, int> edges;
    for (const NodeIndex i : cut.nodes) {
        const Mesh& mesh = model.patches[i];
        for (const Triangle& t : mesh.triangle)
            for (int k = 0; k < 3; ++k) {
                const uint64_t a = latticeKey(mesh.position[t[k]]);
                const uint64_t b = latticeKey(mesh.position[t[(k + 1) % 3]]);
                ++edges[{std::min(a, b), std::max(a, b)}];
            }
    }
    return edges;
}

TEST(Cut, randomCutsAreValidVariedAndRepeatable) {
    for (const ToyTerrain& model : someTerrains()) {
        EXPECT_EQ(checkForest(model.nodes).first_fault, "");
        std::set<std::vector<NodeIndex>> different;
        for (uint64_t seed = 0; seed < 60; ++seed) {
            const Cut cut = randomCut(model.nodes, seed);
            expectConsistent(model.nodes, cut);
            EXPECT_EQ(cut.nodes, randomCut(model.nodes, seed).nodes);
            different.insert(cut.nodes);
        }
        EXPECT_GT(different.size(), 12u);
    }
}

TEST(Cut, validCutsOfTheTerrainHaveNoHoles) {
    // Independent of validateCut(): interior edges are used twice, those of the square's border
    // once.
    const ToyTerrain model = makeToyTerrain();
    const int32_t size = 64 << 5;
    for (uint64_t seed = 0; seed < 40; ++seed) {
        for (const auto& [edge, uses] : edgesOf(model, randomCut(model.nodes, seed))) {
            const Vec3i a = latticePoint(edge[0]), b = latticePoint(edge[1]);
            const bool border = (a.x == b.x && (a.x == 0 || a.x == size)) ||
                                (a.y == b.y && (a.y == 0 || a.y == size));
            ASSERT_EQ(uses, border ? 1 : 2);
        }
    }
}

TEST(Cut, byErrorIsTheCoarsestThatKeepsTheBound) {
    for (const ToyTerrain& model : someTerrains()) {
        const Forest forest(model.nodes);
        const Cut finest = finestCut(model.nodes);
        for (NodeIndex probe = 0; probe < model.nodes.size(); probe += 7) {
            const double bound = model.nodes[probe].error;
            const Cut cut = cutByError(model.nodes, bound);
            expectConsistent(model.nodes, cut);
            EXPECT_LE(cut.max_error, bound);
            EXPECT_FALSE(cut.below_finest);
            for (const NodeIndex i : cut.nodes)
                if (forest.parent(i) != kNoNode) {
                    EXPECT_GT(model.nodes[forest.parent(i)].error, bound);
                }
        }
        const Cut below = cutByError(model.nodes, finest.max_error * 0.999);
        EXPECT_TRUE(below.below_finest);
        EXPECT_EQ(below.nodes, finest.nodes);
        EXPECT_EQ(cutByError(model.nodes, 1e30).nodes, rootCut(model.nodes).nodes);
    }
}

TEST(Cut, byTrianglesIsTheBestThresholdThatFits) {
    for (const ToyTerrain& model : someTerrains()) {
        std::set<float> errors;
        for (const Node& node : model.nodes) errors.insert(node.error);
        const uint64_t all = finestCut(model.nodes).triangles;
        for (uint64_t budget = 8; budget <= all; budget += 1 + all / 50) {
            const Cut cut = cutByTriangles(model.nodes, budget);
            expectConsistent(model.nodes, cut);
            EXPECT_LE(cut.triangles, budget);
            for (const float error : errors) {
                const Cut other = cutByError(model.nodes, error);
                if (other.triangles <= budget) {
                    EXPECT_LE(cut.max_error, other.max_error);
                }
            }
        }
        EXPECT_EQ(cutByTriangles(model.nodes, all).nodes, finestCut(model.nodes).nodes);
        const Cut roots = cutByTriangles(model.nodes, 7);
        EXPECT_TRUE(roots.over_budget);
        EXPECT_EQ(roots.nodes, rootCut(model.nodes).nodes);
        EXPECT_FALSE(cutByTriangles(model.nodes, 8).over_budget);
    }
}

TEST(Cut, byHeightGoesFromFinestToRoots) {
    for (const ToyTerrain& model : someTerrains()) {
        EXPECT_EQ(cutByHeight(model.nodes, 0).nodes, finestCut(model.nodes).nodes);
        uint64_t before = finestCut(model.nodes).triangles + 1;
        for (int height = 0; before > rootCut(model.nodes).triangles; ++height) {
            ASSERT_LT(height, 20);
            const Cut cut = cutByHeight(model.nodes, height);
            expectConsistent(model.nodes, cut);
            EXPECT_LT(cut.triangles, before);
            before = cut.triangles;
        }
    }
}

TEST(Cut, byViewKeepsTheToleranceAndIsNoFinerThanNeeded) {
    const ToyTerrain model = makeToyTerrain();
    const Forest forest(model.nodes);
    const View view(Camera{{500, -900, 3000}, {1000, 1000, 1000}, {0, 0, 1}, 50}, PictureSize{},
                    Lattice{});
    for (const double pixels : {0.5, 2.0, 8.0, 32.0}) {
        const Cut cut = cutByView(model.nodes, view, pixels);
        expectConsistent(model.nodes, cut);
        for (const NodeIndex i : cut.nodes) {
            const Node& node = model.nodes[i];
            if (!node.isLeaf()) {
                EXPECT_LE(view.errorInPixels(node.error, node.saturated), pixels);
            }
            if (forest.parent(i) == kNoNode) continue;
            const Node& parent = model.nodes[forest.parent(i)];
            EXPECT_GT(view.errorInPixels(parent.error, parent.saturated), pixels);
        }
    }
    EXPECT_EQ(cutByView(model.nodes, view, 0).nodes, finestCut(model.nodes).nodes);
}

TEST(Cut, byFaceSizeGoesByThatAndNotByError) {
    const ToyTerrain model = makeToyTerrain();
    const Forest forest(model.nodes);
    const Camera camera{{500, -900, 3000}, {1000, 1000, 1000}, {0, 0, 1}, 50};
    const View view(camera, PictureSize{}, Lattice{}, SelectBy::kFaceSize);
    const auto shows = [&](NodeIndex i) {
        return view.errorInPixels(model.nodes[i].face_size, model.nodes[i].saturated);
    };
    for (const double pixels : {100.0, 300.0, 1000.0}) {
        const Cut cut = cutByView(model.nodes, view, pixels);
        expectConsistent(model.nodes, cut);
        for (const NodeIndex i : cut.nodes) {
            EXPECT_TRUE(model.nodes[i].isLeaf() || shows(i) <= pixels);
            EXPECT_TRUE(forest.parent(i) == kNoNode || shows(forest.parent(i)) > pixels);
        }
        const View by_error(camera, PictureSize{}, Lattice{});
        EXPECT_EQ(cutByView(model.nodes, view.byError(), pixels).nodes,
                  cutByView(model.nodes, by_error, pixels).nodes);
        EXPECT_NE(cutByView(model.nodes, by_error, pixels).nodes, cut.nodes);
    }
}

/// What is left out of a visible cut must be out of sight, by each vertex of its patch.
TEST(Cut, visibleCutLeavesOutOnlyWhatCannotBeSeen) {
    ToyTerrain model = makeToyTerrain();
    for (Node& node : model.nodes) node.closed = true;
    size_t by_frustum = 0, by_cone = 0, by_size = 0;
    for (const Vec3d& eye : {Vec3d(900, 900, 1600), Vec3d(-200, -300, 1100),
                             Vec3d(1000, 900, -9000), Vec3d(900, 900, 2e7)}) {
        const View view(Camera{eye, {1000, 1000, 1000}, {0, 1, 0.1}, 30}, PictureSize{640, 480},
                        Lattice{});
        const double pixels = 1;
        const Cut all = cutByView(model.nodes, view, pixels);
        const auto leftOut = [&](const Culling& culling) {
            const Cut cut = visibleCut(model.nodes, view, pixels, culling);
            EXPECT_TRUE(std::includes(all.nodes.begin(), all.nodes.end(), cut.nodes.begin(),
                                      cut.nodes.end()));
            std::vector<NodeIndex> out;
            std::set_difference(all.nodes.begin(), all.nodes.end(), cut.nodes.begin(),
                                cut.nodes.end(), std::back_inserter(out));
            return out;
        };
        const auto project = [&](const Vec3i& p) {
            const Vec3d d = Vec3d(p) - view.eye();
            return Vec3d(glm::dot(view.right(), d), glm::dot(view.up(), d), 0) * view.focal_px() /
                       -glm::dot(view.back(), d) +
                   Vec3d(0, 0, -glm::dot(view.back(), d));
        };
        EXPECT_TRUE(leftOut({}).empty());
        for (const NodeIndex i : leftOut({.frustum = true})) {
            ++by_frustum;
            for (const Vec3i& p : model.patches[i].position) {
                const Vec3d q = project(p);
                EXPECT_TRUE(q.z <= 0 || std::abs(q.x) > 320 || std::abs(q.y) > 240);
            }
        }
        for (const NodeIndex i : leftOut({.cone = true})) {
            ++by_cone;
            const Mesh& mesh = model.patches[i];
            for (const Triangle& t : mesh.triangle) {
                const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
                EXPECT_GT(glm::dot(glm::cross(b - a, c - a), a - view.eye()), 0);
            }
        }
        for (const NodeIndex i : leftOut({.contribution = true})) {
            ++by_size;
            for (const Vec3i& p : model.patches[i].position)
                for (const Vec3i& q : model.patches[i].position) {
                    const Vec3d d = project(p) - project(q);
                    EXPECT_LE(std::hypot(d.x, d.y), pixels / 2);
                }
        }
    }
    EXPECT_GT(by_frustum, 20u);
    EXPECT_GT(by_cone, 20u);
    EXPECT_GE(by_size, 2u);
    for (Node& node : model.nodes) node.closed = false;
    const View below(Camera{{1000, 900, -9000}, {1000, 1000, 1000}, {0, 1, 0.1}, 30},
                     PictureSize{640, 480}, Lattice{});
    EXPECT_EQ(visibleCut(model.nodes, below, 1, {.cone = true}).nodes,
              cutByView(model.nodes, below, 1).nodes);
}

TEST(Cut, validateNamesTheFault) {
    const ToyTerrain model = makeToyTerrain();
    const std::vector<Node>& nodes = model.nodes;
    const std::vector<NodeIndex> roots = rootCut(nodes).nodes;
    EXPECT_EQ(validateCut(nodes, roots), "");
    std::vector<NodeIndex> broken = roots;
    broken.push_back(NodeIndex(nodes.size()));
    EXPECT_EQ(validateCut(nodes, broken), fmt::format("node {} does not exist", nodes.size()));
    broken.back() = 1;
    EXPECT_EQ(validateCut(nodes, broken), "node 1 is drawn twice");
    broken.back() = nodes[1].child[0];
    EXPECT_EQ(validateCut(nodes, broken),
              fmt::format("node {} is drawn and so is 1 above it", nodes[1].child[0]));
    broken.pop_back();
    broken.pop_back();
    EXPECT_TRUE(validateCut(nodes, broken).starts_with("nothing is drawn above leaf "));
    broken = {0, nodes[1].child[0], nodes[1].child[1]};
    EXPECT_EQ(validateCut(nodes, broken), "group 0 is refined at node 1 but not at node 0");
    EXPECT_EQ(validateCut({}, {}), "");
}

/// Two roots, each with two children and the joint that is drawn where it alone is refined.
std::vector<Node> joinedPair() {
    std::vector<Node> nodes(8);
    for (Node& node : nodes) {
        node.bounds = node.saturated = {Vec3f(0), 10};
        node.triangles = 100;
    }
    for (const uint32_t root : {0u, 1u}) {
        nodes[root].error = 4.0f + float(root);
        nodes[root].group = root;
        nodes[root].child_range = true;
        nodes[root].child[0] = 2 + 3 * root;
        nodes[root].child[1] = 4 + 3 * root;
        for (const uint32_t child : {2u, 3u}) nodes[child + 3 * root].group = 10 + child + 3 * root;
        nodes[4 + 3 * root].is_joint = true;
        nodes[4 + 3 * root].group = 1 - root;
        nodes[4 + 3 * root].error = 5.0f - float(root);
        nodes[4 + 3 * root].triangles = 7;
    }
    return nodes;
}

TEST(Cut, jointsAreDrawnWhereOneSideIsFiner) {
    const std::vector<Node> nodes = joinedPair();
    EXPECT_TRUE(checkForest(nodes).ok()) << checkForest(nodes).first_fault;
    using Nodes = std::vector<NodeIndex>;
    EXPECT_EQ(rootCut(nodes).nodes, (Nodes{0, 1}));
    EXPECT_EQ(cutByError(nodes, 4.5).nodes, (Nodes{0, 5, 6, 7}));
    EXPECT_EQ(finestCut(nodes).nodes, (Nodes{2, 3, 5, 6}));
    EXPECT_EQ(cutByHeight(nodes, 0).nodes, finestCut(nodes).nodes);
    EXPECT_EQ(validateCut(nodes, Nodes{0, 5, 6, 7}), "");
    EXPECT_EQ(validateCut(nodes, Nodes{2, 3, 4, 1}), "");
    EXPECT_EQ(validateCut(nodes, Nodes{0, 5, 6}), "group 0 is refined at node 7 but not at node 0");
    EXPECT_NE(validateCut(nodes, Nodes{2, 3, 5, 6, 7}), "");
    EXPECT_NE(validateCut(nodes, Nodes{0, 1, 7}), "");
    EXPECT_EQ(cutByTriangles(nodes, 306).nodes, rootCut(nodes).nodes);
    EXPECT_EQ(cutByTriangles(nodes, 307).nodes, (Nodes{0, 5, 6, 7}));
    EXPECT_EQ(cutByTriangles(nodes, 400).nodes, finestCut(nodes).nodes);
    std::set<Nodes> seen;
    for (uint64_t seed = 0; seed < 200; ++seed) {
        const Cut cut = randomCut(nodes, seed);
        EXPECT_EQ(validateCut(nodes, cut.nodes), "") << seed;
        seen.insert(cut.nodes);
    }
    EXPECT_EQ(seen.size(), 4u);
}

TEST(Cut, emptyAndSingleNodeModels) {
    EXPECT_TRUE(rootCut({}).nodes.empty());
    EXPECT_TRUE(randomCut({}, 1).nodes.empty());
    EXPECT_TRUE(cutByTriangles({}, 5).nodes.empty());
    std::vector<Node> one(1);
    one[0].triangles = 0;
    EXPECT_EQ(finestCut(one).nodes, std::vector<NodeIndex>{0});
    EXPECT_EQ(cutByTriangles(one, 0).nodes, std::vector<NodeIndex>{0});
    EXPECT_FALSE(cutByTriangles(one, 0).over_budget);
    for (uint64_t seed = 0; seed < 9; ++seed) expectConsistent(one, randomCut(one, seed));
}

TEST(Forest, checkFindsEachFault) {
    const std::vector<Node> good = makeToyTerrain().nodes;
    EXPECT_TRUE(checkForest(good).ok());
    EXPECT_EQ(checkForest(good).links, good.size() - 2);
    const NodeIndex inner = good[0].child[0];

    std::vector<Node> nodes = good;
    nodes[inner].error = nodes[0].error * 1.001f;
    EXPECT_GT(checkForest(nodes).not_monotone, 0u);
    nodes[inner].error = std::numeric_limits<float>::quiet_NaN();
    EXPECT_GT(checkForest(nodes).not_monotone, 0u);

    nodes = good;
    nodes[inner].bounds.radius = nodes[inner].saturated.radius * 1.001f;
    EXPECT_EQ(checkForest(nodes).not_nested, 1u);
    nodes = good;
    nodes[inner].saturated.centre.x += 2 * nodes[0].saturated.radius;
    EXPECT_GT(checkForest(nodes).not_nested, 0u);

    nodes = good;
    nodes[1].error = std::nextafter(nodes[1].error, 1e30f);
    EXPECT_EQ(checkForest(nodes).broken_groups, 1u);
    nodes = good;
    nodes[1].child[0] = nodes[1].child[1] = kNoNode;
    EXPECT_EQ(checkForest(nodes).broken_groups, 1u);

    nodes = good;
    nodes[0].child[0] = NodeIndex(nodes.size());
    EXPECT_EQ(checkForest(nodes).first_fault,
              fmt::format("node 0: child {} does not exist", nodes.size()));
    nodes = good;
    nodes[0].child[0] = nodes[1].child[0];
    EXPECT_EQ(checkForest(nodes).bad_links, 1u);
    nodes = good;
    NodeIndex leaf = 0;
    while (!nodes[leaf].isLeaf()) leaf = nodes[leaf].child[0];
    nodes[leaf].child[0] = 0;  // a cycle that takes the root with it
    EXPECT_GT(checkForest(nodes).bad_links, 0u);
    EXPECT_THROW(Forest{nodes}, BugError);
}

}  // namespace
}  // namespace pietra
