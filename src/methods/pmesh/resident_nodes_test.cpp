// Operations that come and go: what is drawn does not depend on when they came.

#include "methods/pmesh/resident_nodes.h"

#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

/// A model whose nodes arrive, at most so many after each frame.
class OutOfCore {
public:
    OutOfCore(const NodeForest& forest, uint32_t most)
        : forest_(forest), nodes(forest, most), adaption(nodes.mesh(), &nodes) {}

    PassCounts frame(const Criterion& view, size_t arrivals = 1, int passes = 1 << 30) {
        const PassCounts counts = adaption.frame(view, passes);
        nodes.note(adaption);
        for (const NodeIndex n : nodes.requests(arrivals))
            arrived += nodes.arrive(n, forest_.node[n]);
        return counts;
    }
    /// Until nothing is left to do and to load. False if that takes too long.
    [[nodiscard]] bool settle(const Criterion& view) {
        for (int i = 0; i < 2000; ++i) {
            const size_t before = arrived;
            if (frame(view).operations() == 0 && arrived == before)
                return nodes.requests(1).empty();
        }
        return false;
    }

private:
    const NodeForest& forest_;

public:
    ResidentNodes nodes;
    Adaption adaption;
    size_t arrived = 0;
};

/// What tolerances are multiplied by.
class DetailFactor {
public:
    double value() const { return value_; }
    void update(size_t required, size_t most) {
        if (required > most) {
            value_ *= 1.05;
        } else if (double(required) < 0.85 * double(most)) {
            value_ = std::max(value_ / 1.02, 1.0);
        }
    }

private:
    double value_ = 1;
};

class Nodes : public testing::Test {
public:
    static constexpr uint32_t kPlenty = 1000;
    static const Built& builtOnce() {
        static const Built built = buildFor(onLattice(dented(test::sphereShape(60), 0.004), 30000));
        return built;
    }
    const Built& built_ = builtOnce();
    const NodeForest& forest_ = built_.forest;
    Adaption in_core_{built_.mesh};
    std::mt19937 random_{21};
};

TEST_F(Nodes, ArriveInAnyOrderAndLeaveAndTheMeshIsTheSame) {
    ASSERT_GT(forest_.node.size(), 10u);
    OutOfCore walker(forest_, kPlenty);
    uint32_t evicted = 0;
    for (int i = 0; i < 8; ++i) {
        const Criterion view = randomView(random_, built_.input);
        for (int frame = 0; frame < 30; ++frame) {
            walker.frame(view, 0, 2);
            const std::vector<NodeIndex> asked = walker.nodes.requests(kPlenty);
            if (!asked.empty() && random_() % 2 == 0) {
                const NodeIndex n = asked[random_() % asked.size()];
                EXPECT_TRUE(walker.nodes.arrive(n, forest_.node[n]));
            }
            evicted += walker.nodes.evict(NodeIndex(random_() % forest_.node.size()));
            expectSound(walker.adaption.mesh());
        }
        EXPECT_TRUE(walker.settle(view));
        in_core_.settle(view);
        expectSame(walker.adaption.mesh(), in_core_.mesh());
    }
    EXPECT_GT(evicted, 0u);
    EXPECT_EQ(walker.adaption.refused(), 0u);
}

/// All near a point of the sphere, and nothing beyond.
Criterion spot(std::mt19937& random, const Mesh& mesh, int32_t reach) {
    Criterion view;
    view.eye = mesh.position[random() % mesh.position.size()];
    for (size_t code = 1; code < 256; ++code) view.reach[code] = reach;
    return view;
}

TEST_F(Nodes, AreLoadedOnlyIfTheirOperationsMayBeNeeded) {
    OutOfCore walker(forest_, kPlenty);
    const Criterion view = spot(random_, built_.input, 20);
    EXPECT_TRUE(walker.settle(view));
    in_core_.settle(view);
    expectSame(walker.adaption.mesh(), in_core_.mesh());
    EXPECT_LT(walker.nodes.loaded(), forest_.node.size());
}

/// Negative control: neighbours that must split first are not needed themselves.
TEST_F(Nodes, StarveWhereOnlyWhatTheViewNeedsIsAskedFor) {
    const Built built = buildFor(onLattice(dented(test::sphereShape(120), 0.002), 30000));
    const NodeForest& forest = built.forest;
    Adaption in_core(built.mesh);
    int starved = 0;
    for (int i = 0; i < 10 && (i < 3 || starved == 0); ++i) {
        OutOfCore walker(forest, kPlenty);
        const Criterion view = spot(random_, built.input, 40);
        for (int frame = 0; frame < 150; ++frame) {
            walker.frame(view, 0);
            for (const Adaption::Waiting& w : walker.adaption.waiting())
                if (w.is_needed && !walker.nodes.isLoaded(nodeOf(w.operation)) &&
                    walker.nodes.arrive(nodeOf(w.operation), forest.node[nodeOf(w.operation)]))
                    break;
        }
        in_core.settle(view);
        starved += walker.adaption.mesh().vertexCount() < in_core.mesh().vertexCount();
        EXPECT_TRUE(walker.settle(view));
        expectSame(walker.adaption.mesh(), in_core.mesh());
    }
    EXPECT_GT(starved, 0);
}

/// Of many nodes: where errors are alike, a tolerance a little smaller needs several more at once,
/// of which some number must lie within the dead band.
TEST_F(Nodes, KeepTheirBudgetInEveryFrameAndSettle) {
    const Built built = buildFor(onLattice(dented(test::sphereShape(120), 0.002), 30000));
    const auto most = uint32_t(built.forest.node.size() / 3);
    OutOfCore walker(built.forest, most);
    DetailFactor detail;
    for (int view = 0; view < 3; ++view) {
        const Vec3i eye = randomView(random_, built.input).eye;
        int changes = 0;
        for (int frame = 0; frame < 500; ++frame) {
            Criterion criterion;
            criterion.eye = eye;
            for (uint32_t code = 1; code < 256; ++code)
                criterion.reach[code] =
                    int32_t(std::min(double(decodeError(code)) * 4000 / detail.value(), 0x1p25));
            walker.frame(criterion, 2, 4);
            const double before = detail.value();
            detail.update(walker.nodes.required(), most);
            EXPECT_LE(walker.nodes.loaded(), most);
            if (frame >= 400) changes += detail.value() != before;
        }
        EXPECT_EQ(changes, 0);
        EXPECT_GT(detail.value(), 1.0);
        EXPECT_GT(double(walker.nodes.required()), 0.7 * most);
    }
}

TEST_F(Nodes, AskedForInEachFrameArriveInTime) {
    OutOfCore walker(forest_, kPlenty);
    const Criterion view = everything();
    std::map<NodeIndex, size_t> since;
    for (size_t frame = 0; walker.nodes.loaded() < forest_.node.size(); ++frame) {
        ASSERT_LT(frame, 4 * forest_.node.size());
        walker.frame(view, 1, 3);
        const std::vector<NodeIndex> asked = walker.nodes.requests(kPlenty);
        for (const NodeIndex n : asked) {
            const auto [it, is_new] = since.try_emplace(n, frame);
            // Before it, at most those that were asked for when it was, or in the same frame.
            EXPECT_LE(frame - it->second, forest_.node.size()) << n;
        }
    }
}

TEST_F(Nodes, WithAppliedOperationsStay) {
    OutOfCore walker(forest_, kPlenty);
    EXPECT_TRUE(walker.settle(everything()));
    for (NodeIndex n = 0; n < forest_.node.size(); ++n) EXPECT_FALSE(walker.nodes.evict(n));
    walker.adaption.settle(nothing());
    walker.nodes.note(walker.adaption);
    for (NodeIndex n = NodeIndex(forest_.node.size()); n-- > 0;)
        EXPECT_EQ(walker.nodes.evict(n), forest_.row[n].parent != kNoNode);
}

/// Whatever is wrong with nodes that have no fault by themselves, what they do to the mesh is left
/// undone: it stays a mesh, and everything ends.
TEST_F(Nodes, ThatDoNotFitLeaveAMesh) {
    uint32_t refused = 0, given_up = 0;
    for (int round = 0; round < 6; ++round) {
        NodeForest damaged = forest_;
        for (NodeIndex n = 1; n < damaged.node.size(); ++n) {
            if (random_() % 2) continue;
            OperationNode& node = damaged.node[n];
            const OperationNode whole = node;
            NodeOperation& o = node.operation[random_() % node.operation.size()];
            switch (random_() % 5) {
                case 0:
                    o.ranks = uint8_t(random_());
                    break;
                case 1:
                    o.structure = StructureWord::of(o.structure.child(0), o.structure.child(1),
                                                    uint32_t(random_() % 300));
                    break;
                case 2:
                    o.shift = uint8_t(random_() % 21);
                    o.delta[0][0] = int8_t(random_());
                    break;
                case 3:
                    for (auto& levels : node.reference_level)
                        for (uint16_t& level : levels) level = uint16_t(level + random_() % 9);
                    break;
                default:
                    node = forest_.node[random_() % forest_.node.size()];
            }
            if (!faultOf(n, damaged.row[n], node).empty()) node = whole;
        }
        OutOfCore walker(damaged, kPlenty);
        const Topology topology = topologyOf(walker.adaption.mesh());
        for (int i = 0; i < 6; ++i) {
            const Criterion view = i % 3 == 2 ? everything() : randomView(random_, built_.input);
            EXPECT_TRUE(walker.settle(view));
            EXPECT_EQ(topologyOf(walker.adaption.mesh()), topology);
        }
        refused += walker.adaption.refused();
        for (NodeIndex n = 0; n < damaged.node.size(); ++n) given_up += walker.nodes.isGivenUp(n);
    }
    EXPECT_GT(refused, 10u);
    EXPECT_GT(given_up, 0u);
}

}  // namespace
}  // namespace pietra::pmesh
