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

constexpr Culling kNothing{}, kAll{true, true, true};

/// By the definition, from nothing but which pages are resident.
bool openByDefinition(const Residency& residency, uint32_t group, const View& view, double pixels,
                      const Culling& culling) {
    const Forest& forest = residency.forest();
    for (const NodeIndex i : forest.members(group)) {
        if (forest.node(i).isLeaf()) return false;
        for (const NodeIndex child : forest.node(i).child)
            if (child != kNoNode && !residency.resident(forest.node(child).page) &&
                !patchInvisible(forest.node(child), view, pixels, culling))
                return false;
        const NodeIndex parent = forest.parent(i);
        if (parent != kNoNode &&
            !openByDefinition(residency, forest.groupOf(parent), view, pixels, culling))
            return false;
    }
    return true;
}

/// The valid cut of which a frame draws what can be seen.
std::vector<NodeIndex> wholeCut(const Residency& residency, const View& view, double pixels,
                                const Culling& culling) {
    const Forest& forest = residency.forest();
    std::vector<NodeIndex> stack = forest.roots(), cut;
    while (!stack.empty()) {
        const NodeIndex i = stack.back();
        stack.pop_back();
        const Node& node = forest.node(i);
        if (!(view.errorInPixels(node.error, node.saturated) > pixels) ||
            !openByDefinition(residency, forest.groupOf(i), view, pixels, culling)) {
            cut.push_back(i);
            continue;
        }
        for (const NodeIndex child : node.child)
            if (child != kNoNode) stack.push_back(child);
    }
    std::sort(cut.begin(), cut.end());
    return cut;
}

class Dweller {
public:
    Dweller(Residency& residency, unsigned seed) : residency_(residency), random_(seed) {}

    /// A page arrives or leaves, rather a coarse one or a fine one; but roots stay.
    void step(double chance_to_arrive) {
        const bool arrive = std::uniform_real_distribution<>(0, 1)(random_) < chance_to_arrive;
        std::vector<PageIndex> possible;
        for (PageIndex page = 0; page < residency_.pageCount(); ++page)
            if (residency_.resident(page) != arrive) possible.push_back(page);
        if (possible.empty()) return;
        const size_t a = random_() % possible.size(), b = random_() % possible.size();
        const PageIndex page = possible[arrive ? std::min(a, b) : std::max(a, b)];
        arrive ? residency_.arrive(page) : residency_.leave(page);
        for (const NodeIndex root : residency_.forest().roots())
            if (const PageIndex p = residency_.forest().node(root).page; !residency_.resident(p))
                residency_.arrive(p);
    }

private:
    Residency& residency_;
    std::mt19937 random_;
};

void arriveRoots(Residency& residency) {
    for (const NodeIndex root : residency.forest().roots())
        if (const PageIndex page = residency.forest().node(root).page; !residency.resident(page))
            residency.arrive(page);
}

Camera cameraAt(std::mt19937& random) {
    std::uniform_real_distribution<double> place(0, 64 * 32), height(20, 4000);
    Camera camera;
    camera.eye = {place(random), place(random), height(random)};
    camera.target = {place(random), place(random), 0};
    return camera;
}

TEST(ForestRefiner, everyFrameIsWhatCanBeSeenOfAValidCutWhateverHasArrived) {
    size_t finest = 0, coarsest = ~size_t(0), unseen_missing = 0;
    constexpr double kPixels = 0.5;
    for (unsigned seed = 0; seed < 6; ++seed) {
        const PagedTerrain terrain(seed);
        const Forest forest(terrain.nodes);
        Residency residency(forest, terrain.pages);
        arriveRoots(residency);
        ForestRefiner refiner(residency);
        Dweller dweller(residency, seed);
        std::mt19937 random(seed);
        Selection selection;
        for (int step = 0; step < 400; ++step) {
            dweller.step(step % 100 < 60 ? 0.95 : 0.05);
            const View view(cameraAt(random), {640, 480}, Lattice{});
            const Culling& culling = step % 2 != 0 ? kAll : kNothing;
            refiner.select(view, kPixels, culling, selection);
            const std::vector<NodeIndex> whole = wholeCut(residency, view, kPixels, culling);
            ASSERT_EQ(validateCut(terrain.nodes, whole), "");
            std::vector<NodeIndex> seen;
            for (const NodeIndex i : whole)
                if (!patchInvisible(terrain.nodes[i], view, kPixels, culling))
                    seen.push_back(i);
                else
                    unseen_missing += !residency.resident(terrain.nodes[i].page);
            ASSERT_EQ(selection.draw, seen);
            for (const NodeIndex i : seen) ASSERT_TRUE(residency.resident(terrain.nodes[i].page));
            if (step % 2 == 0) {
                finest = std::max(finest, seen.size());
                coarsest = std::min(coarsest, seen.size());
            }
            for (const PageRequest& request : selection.requests)
                ASSERT_FALSE(residency.resident(request.page));
        }
    }
    EXPECT_GT(finest, 10 * coarsest);
    EXPECT_GT(unseen_missing, 0u);
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
        const Culling& culling = kAll;
        refiner.select(view, 0.3, culling, selection);
        for (const PageRequest& request : selection.requests) residency.arrive(request.page);
        refiner.select(view, 0.3, culling, selection);
        EXPECT_TRUE(selection.requests.empty());
        EXPECT_EQ(selection.draw, visibleCut(terrain.nodes, view, 0.3, culling).nodes);
        // What is not used may go, and nothing changes.
        const std::vector<NodeIndex> before = selection.draw;
        for (PageIndex page = 0; page < terrain.pages; ++page)
            if (residency.resident(page) && !refiner.used(page)) residency.leave(page);
        refiner.select(view, 0.3, culling, selection);
        EXPECT_EQ(selection.draw, before);
        EXPECT_TRUE(selection.requests.empty());
    }
}

}  // namespace
}  // namespace pietra
