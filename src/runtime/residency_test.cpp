#include "runtime/residency.h"

#include <gtest/gtest.h>

#include <random>
#include <set>

#include "multires/toy_terrain.h"
#include "runtime/forest_refiner.h"

namespace pietra {
namespace {

/// A terrain whose nodes lie in pages of a few, some groups in two.
struct PagedTerrain {
    std::vector<Node> nodes;
    uint32_t pages = 0;

    explicit PagedTerrain(uint64_t seed) {
        ToyTerrainSettings settings;
        settings.seed = seed;
        nodes = makeToyTerrain(settings).nodes;
        std::vector<uint32_t> used(32, 5);
        std::vector<uint32_t> page_of(32, 0);
        for (Node& node : nodes) {
            if (used[node.level] == 5) {
                page_of[node.level] = pages++;
                used[node.level] = 0;
            }
            ++used[node.level];
            node.page = page_of[node.level];
        }
    }
};

/// By the definition, from nothing but which pages are resident.
bool openByDefinition(const Forest& forest, const Residency& residency, uint32_t group) {
    for (const NodeIndex i : forest.members(group)) {
        if (forest.node(i).isLeaf()) return false;
        for (const NodeIndex child : forest.node(i).child)
            if (child != kNoNode && !residency.resident(forest.node(child).page)) return false;
        const NodeIndex parent = forest.parent(i);
        if (parent != kNoNode && !openByDefinition(forest, residency, forest.groupOf(parent)))
            return false;
    }
    return true;
}

class Dweller {
public:
    Dweller(Residency& residency, uint32_t pages, unsigned seed)
        : residency_(residency), pages_(pages), random_(seed) {}

    /// Something that may arrive arrives, or something that may leave leaves.
    void step(double chance_to_arrive) {
        const bool arrive = std::uniform_real_distribution<>(0, 1)(random_) < chance_to_arrive;
        std::vector<PageIndex> possible;
        for (PageIndex page = 0; page < pages_; ++page)
            if (arrive ? !residency_.resident(page) && residency_.mayArrive(page)
                       : residency_.resident(page) && residency_.mayLeave(page))
                possible.push_back(page);
        if (possible.empty()) return;
        const PageIndex page = possible[random_() % possible.size()];
        arrive ? residency_.arrive(page) : residency_.leave(page);
    }

private:
    Residency& residency_;
    uint32_t pages_;
    std::mt19937 random_;
};

void arriveRoots(Residency& residency) {
    for (const NodeIndex root : residency.forest().roots())
        if (const PageIndex page = residency.forest().node(root).page; !residency.resident(page))
            residency.arrive(page);
}

TEST(Residency, openIsWhatTheDefinitionSays) {
    for (unsigned seed = 0; seed < 6; ++seed) {
        const PagedTerrain terrain(seed);
        const Forest forest(terrain.nodes);
        Residency residency(forest, terrain.pages);
        Dweller dweller(residency, terrain.pages, seed);
        for (int step = 0; step < 300; ++step) {
            dweller.step(step < 150 ? 0.8 : 0.4);
            if (step % 10 != 0) continue;
            for (uint32_t group = 0; group < forest.groupCount(); ++group)
                ASSERT_EQ(residency.open(group), openByDefinition(forest, residency, group));
        }
    }
}

Camera cameraAt(std::mt19937& random) {
    std::uniform_real_distribution<double> place(0, 64 * 32), height(20, 4000);
    Camera camera;
    camera.eye = {place(random), place(random), height(random)};
    camera.target = {place(random), place(random), 0};
    return camera;
}

TEST(Residency, everyFrameIsAValidCutWhateverHasArrived) {
    size_t finest = 0, coarsest = ~size_t(0);
    for (unsigned seed = 0; seed < 6; ++seed) {
        const PagedTerrain terrain(seed);
        const Forest forest(terrain.nodes);
        Residency residency(forest, terrain.pages);
        arriveRoots(residency);
        ForestRefiner refiner(residency);
        Dweller dweller(residency, terrain.pages, seed);
        std::mt19937 random(seed);
        Selection selection;
        for (int step = 0; step < 400; ++step) {
            dweller.step(step % 100 < 60 ? 0.9 : 0.1);
            arriveRoots(residency);
            refiner.select(View(cameraAt(random), {640, 480}, Lattice{}), 0.5, {}, selection);
            ASSERT_EQ(validateCut(terrain.nodes, selection.draw), "");
            finest = std::max(finest, selection.draw.size());
            coarsest = std::min(coarsest, selection.draw.size());
            for (const PageRequest& request : selection.requests)
                ASSERT_FALSE(residency.resident(request.page));
        }
    }
    EXPECT_GT(finest, 10 * coarsest);
}

// Negative control: without the groups above, cuts are not valid.
TEST(Residency, childrenAloneAreNotEnough) {
    int invalid = 0;
    for (unsigned seed = 0; seed < 6; ++seed) {
        const PagedTerrain terrain(seed);
        const Forest forest(terrain.nodes);
        std::mt19937 random(seed);
        std::vector<uint8_t> resident(terrain.pages);
        for (uint8_t& r : resident) r = random() % 4 != 0;
        std::vector<NodeIndex> stack = forest.roots(), cut;
        while (!stack.empty()) {
            const Node& node = terrain.nodes[stack.back()];
            bool all = !node.isLeaf();
            for (const NodeIndex child : node.child)
                all = all && (child == kNoNode || resident[terrain.nodes[child].page]);
            const NodeIndex i = stack.back();
            stack.pop_back();
            if (!all) {
                cut.push_back(i);
                continue;
            }
            for (const NodeIndex child : node.child)
                if (child != kNoNode) stack.push_back(child);
        }
        invalid += !validateCut(terrain.nodes, cut).empty();
    }
    EXPECT_GT(invalid, 3);
}

TEST(ForestRefiner, whatItRequestsAtOnceLeadsToTheOfflineCut) {
    const PagedTerrain terrain(3);
    const Forest forest(terrain.nodes);
    Residency residency(forest, terrain.pages);
    arriveRoots(residency);
    ForestRefiner refiner(residency);
    std::mt19937 random(9);
    Selection selection;
    for (int i = 0; i < 20; ++i) {
        const View view(cameraAt(random), {640, 480}, Lattice{});
        const Culling culling{true, true, true};
        refiner.select(view, 0.3, culling, selection);
        for (const PageRequest& request : selection.requests) residency.arrive(request.page);
        refiner.select(view, 0.3, culling, selection);
        EXPECT_TRUE(selection.requests.empty());
        EXPECT_EQ(selection.draw, visibleCut(terrain.nodes, view, 0.3, culling).nodes);
        // What is not used may go, and nothing changes.
        const std::vector<NodeIndex> before = selection.draw;
        for (bool again = true; again;) {
            again = false;
            for (PageIndex page = 0; page < terrain.pages; ++page)
                if (residency.resident(page) && residency.mayLeave(page) && !refiner.used(page)) {
                    residency.leave(page);
                    again = true;
                }
        }
        refiner.select(view, 0.3, culling, selection);
        EXPECT_EQ(selection.draw, before);
        EXPECT_TRUE(selection.requests.empty());
    }
}

}  // namespace
}  // namespace pietra
