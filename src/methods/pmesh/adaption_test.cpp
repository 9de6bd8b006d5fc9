// Adaption: what passes do to the mesh, against what must come out.

#include "methods/pmesh/adaption.h"

#include <filesystem>

#include "base/parallel.h"
#include "methods/pmesh/criterion_scan.h"
#include "methods/pmesh/pmesh_testing.h"
#include "methods/pmesh/whole_mesh.h"

namespace pietra::pmesh {
namespace {

class Adapted : public testing::TestWithParam<TestMesh> {};
INSTANTIATE_TEST_SUITE_P(Pmesh, Adapted, testing::ValuesIn(testMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

/// The dependencies of each operation, spelt out one by one, as Xia and Varshney have them: before
/// it, all that made its star. And where the vertex that it splits lies.
struct Reference {
    std::vector<std::vector<OperationId>> needs;
    std::vector<Vec3i> centre;
    std::vector<OperationId> order;

    explicit Reference(const ProgressiveMesh& source)
        : needs(source.operation.size()),
          centre(source.operation.size()),
          order(coarseToFine(source)) {
        ActiveMesh mesh(source);
        std::map<OperationId, uint32_t> waiting;
        const auto wait = [&](uint32_t v) {
            if (mesh.record[v].next != kNoOperation) waiting[mesh.record[v].next] = v;
        };
        for (uint32_t v = 0; v < mesh.vertexCount(); ++v) wait(v);
        for (const OperationId id : order) {
            const uint32_t v = waiting.at(id);
            const auto need = [&](uint32_t w) {
                if (mesh.record[w].last != kNoOperation) needs[id].push_back(mesh.record[w].last);
                return true;
            };
            need(v);
            mesh.allNeighbours(v, need);
            centre[id] = mesh.vertex[v].position();
            EXPECT_TRUE(mesh.apply(v));
            wait(v);
            if (!source.operation[id].isDummy()) wait(uint32_t(mesh.vertexCount() - 1));
        }
    }

    std::vector<uint8_t> closure(const ProgressiveMesh& source, const Criterion& criterion) const {
        std::vector<uint8_t> in(needs.size(), 0);
        for (size_t i = order.size(); i-- > 0;) {
            const OperationId o = order[i];
            const Operation& op = source.operation[o];
            in[o] |= criterion.needs(centre[o], op.error, op.radius, op.normals.word());
            if (in[o])
                for (const OperationId d : needs[o]) in[d] = 1;
        }
        return in;
    }
};

std::vector<uint8_t> applied(const ActiveMesh& mesh) {
    const std::vector<Operation>& operation = mesh.source().operation;
    std::vector<OperationId> parent(operation.size(), kNoOperation);
    for (OperationId o = 0; o < operation.size(); ++o)
        for (const int end : {0, 1})
            if (operation[o].childOf(end) != kNoOperation) parent[operation[o].childOf(end)] = o;
    std::vector<uint8_t> in(operation.size(), 0);
    for (const VertexRecord& r : mesh.record)
        for (OperationId o = r.last; o != kNoOperation && !in[o]; o = parent[o]) in[o] = 1;
    return in;
}

TEST_P(Adapted, IsTheClosureOfWhatIsNeededWhateverWasBefore) {
    const Built built = buildFor(GetParam().make());
    const Reference reference(built.mesh);
    std::mt19937 random(11);
    Adaption walker(built.mesh), coarse(built.mesh), fine(built.mesh);
    for (int i = 0; i < 12; ++i) {
        Criterion view = randomView(random, built.input);
        if (i % 2 == 0) view.occlusion = randomOcclusion(random, built.input);
        view.hides_backs = i % 4 >= 2;
        coarse.settle(nothing());
        fine.settle(everything());
        for (Adaption* adaption : {&walker, &coarse, &fine}) {
            adaption->settle(view);
            EXPECT_EQ(applied(adaption->mesh()), reference.closure(built.mesh, view));
        }
        expectSame(walker.mesh(), coarse.mesh());
        expectSame(walker.mesh(), fine.mesh());
    }
}

TEST_P(Adapted, StaysAMeshInEveryPass) {
    const Built built = buildFor(GetParam().make());
    Adaption adaption(built.mesh);
    const Topology topology = topologyOf(adaption.mesh());
    std::mt19937 random(12);
    uint64_t operations = 0;
    for (int pass = 0; pass < 200 && !testing::Test::HasFailure(); ++pass) {
        operations += adaption.pass(randomView(random, built.input)).operations();
        expectSound(adaption.mesh());
        EXPECT_EQ(topologyOf(adaption.mesh()), topology);
    }
    EXPECT_EQ(operations > 0, !built.mesh.operation.empty());
}

TEST_P(Adapted, AHundredCyclesLeaveTheBaseBitForBit) {
    const Built built = buildFor(GetParam().make());
    Adaption adaption(built.mesh);
    std::mt19937 random(13);
    for (int cycle = 0; cycle < 100; ++cycle) {
        for (uint32_t pass = 0; pass < random() % 8; ++pass)
            adaption.pass(randomView(random, built.input));
        if (cycle % 10 == 9) adaption.settle(nothing());
    }
    const ActiveMesh base(built.mesh);
    EXPECT_EQ(adaption.mesh().vertex, base.vertex);
    EXPECT_EQ(adaption.mesh().face, base.face);
}

NormalBox randomBox(std::mt19937& random) {
    std::normal_distribution<double> any, near(0, 0.3);
    const Vec3d middle(any(random), any(random), any(random));
    NormalBox box = NormalBox::none();
    for (uint32_t i = 0; i < 1 + random() % 3; ++i)
        box.add(middle + Vec3d(near(random), near(random), near(random)));
    return box;
}

/// What is said to face away does, from all points of the sphere, whatever the normal of the box.
TEST(Criterion, FacesAwayOnlyIfAllDo) {
    std::mt19937 random(18);
    std::normal_distribution<double> any;
    uint32_t away = 0;
    for (int i = 0; i < 20000; ++i) {
        const auto radius = int64_t(random() % 300);
        const Vec3d to_sphere = 400.0 * Vec3d(any(random), any(random), any(random));
        const Vec3l d(to_sphere);
        NormalBox box = NormalBox::none();
        std::vector<Vec3d> normals;
        for (uint32_t j = 0; j < 1 + random() % 4; ++j) {
            normals.push_back(
                glm::normalize(to_sphere + 300.0 * Vec3d(any(random), any(random), any(random))));
            box.add(normals.back());
        }
        if (!Criterion::facesAway(d, radius, box.word())) continue;
        ++away;
        for (const Vec3d& n : normals) EXPECT_GT(glm::dot(n, Vec3d(d) - double(radius) * n), 0);
    }
    EXPECT_GT(away, 2000u);
}

/// Nor does a sphere within one that faces away show its front, be it at the rim where the box's
/// longest normal points.
TEST(Criterion, FacesAwayWithAllThatIsWithin) {
    std::mt19937 random(19);
    std::normal_distribution<double> any;
    uint32_t away = 0;
    for (int i = 0; i < 20000; ++i) {
        const Vec3l d(3000.0 * Vec3d(any(random), any(random), any(random)));
        const NormalBox box = randomBox(random);
        Vec3d nearest;
        for (int k = 0; k < 3; ++k)
            nearest[k] = d[k] > 0 ? box.low(size_t(k)) : box.high(size_t(k));
        int64_t radius = 0;
        while (Criterion::facesAway(d, radius + 8, box.word())) radius += 8;
        if (radius < 64) continue;
        ++away;
        const Vec3l to_rim(-double(radius) * glm::normalize(nearest));
        EXPECT_TRUE(Criterion::facesAway(d + to_rim, 0, box.word()));
    }
    EXPECT_GT(away, 1000u);
}

TEST(Criterion, NeedsNoSphereWithinOneThatItDoesNotNeed) {
    const Mesh mesh = onLattice(test::sphereShape(8), 1 << 14);
    std::mt19937 random(16);
    const auto below = [&](uint32_t limit) { return int32_t(random() % limit); };
    uint32_t inner_needed = 0, outer_only = 0, hidden = 0, away = 0;
    for (int i = 0; i < 400; ++i) {
        Criterion view = randomView(random, mesh);
        Criterion in_the_open = view;
        in_the_open.hides_backs = false;
        if (i % 2 == 0) view.occlusion = randomOcclusion(random, mesh);
        for (int j = 0; j < 500; ++j) {
            const Vec3i centre(below(1 << 14), below(1 << 14), below(1 << 14));
            const int32_t radius = below(200), range = 1 + below(500);
            const Vec3i offset(below(2 * range) - range, below(2 * range) - range,
                               below(2 * range) - range);
            const uint32_t inner = encodeRoundedUp<11>(uint64_t(radius));
            const double reach = glm::length(Vec3d(offset)) + decodeRadius(inner);
            const uint32_t outer = encodeRoundedUp<11>(uint64_t(std::ceil(reach)));
            const auto error = uint32_t(1 + below(255)),
                       more = error + uint32_t(below(256 - error));
            NormalBox normals = randomBox(random), around = normals;
            if (j % 2 == 0) around.add(randomBox(random));
            const bool is_needed = view.needs(centre + offset, error, inner, normals.word());
            const bool is_outer_needed = view.needs(centre, more, outer, around.word());
            EXPECT_TRUE(is_outer_needed || !is_needed);
            inner_needed += is_needed;
            outer_only += is_outer_needed && !is_needed;
            if (is_needed || !in_the_open.needs(centre + offset, error, inner, 0)) continue;
            ++(view.occlusion ? hidden : away);
        }
    }
    EXPECT_GT(hidden, 500u);
    EXPECT_GT(away, 500u);
    EXPECT_GT(inner_needed, 1000u);
    EXPECT_GT(outer_only, 1000u);
}

/// So that the sphere's edge is as close to facing away as may be.
void setAcross(VertexCriteria& c, const Vec3i& d) {
    const NormalBox box = NormalBox::ofBits(c.split_normals);
    int64_t along = 0;
    for (int k = 0; k < 3; ++k)
        along += std::min<int64_t>(int64_t(box.low(size_t(k))) * d[k],
                                   int64_t(box.high(size_t(k))) * d[k]);
    if (along > 0)
        c.split_radius = uint16_t(std::min(
            encodeRoundedUp<11>(uint64_t(2 * along / (c.split_normals >> 24))), kMaxRadiusCode));
}

TEST(Criterion, DecidesTheSameOfManyVerticesAtOnce) {
    const Mesh mesh = onLattice(test::sphereShape(8), 1 << 12);
    std::mt19937 random(17);
    std::vector<Vertex> vertex(64);
    std::vector<VertexCriteria> criteria(64);
    uint32_t needed = 0, close = 0;
    for (int i = 0; i < 2000; ++i) {
        Criterion view = randomView(random, mesh);
        if (i % 4 == 0) view.occlusion = randomOcclusion(random, mesh);
        for (size_t k = 0; k < 64; ++k) {
            // Some as close to the limit as may be.
            const auto error = uint8_t(1 + random() % 255);
            const int32_t reach = view.reach[error];
            const Vec3i p =
                random() % 2 ? mesh.position[random() % mesh.position.size()]
                             : view.eye + Vec3i(std::min(reach, 1 << 22), int32_t(random() % 3), 0);
            vertex[k] = {p.x, p.y, p.z, 0};
            VertexCriteria& c = criteria[k];
            c.split_radius = uint16_t(random() % (random() % 2 ? 3 : kMaxRadiusCode));
            c.merge_radius = random() % 4 ? uint16_t(random() % 3000) : VertexCriteria::kEverNeeded;
            if (random() % 8 == 0) c.merge_radius |= VertexCriteria::kBlocked;
            c.split_error = error;
            c.merge_error = uint8_t(random());
            c.split_normals = randomBox(random).word();
            c.merge_normals = randomBox(random).word();
            if (random() % 2) setAcross(c, p - view.eye);
        }
        const size_t count = 1 + random() % 64;
        const ScanBits bits = scanVertices(view, vertex.data(), criteria.data(), count);
        for (size_t k = 0; k < 64; ++k) {
            const bool is_there = k < count;
            EXPECT_EQ(bits.split >> k & 1, is_there && view.needsSplit(vertex[k], criteria[k]));
            EXPECT_EQ(bits.merge >> k & 1, is_there && !view.needsLast(vertex[k], criteria[k]));
            needed += bits.split >> k & 1;
            Vertex next = vertex[k];
            ++next.x;
            close += view.needsSplit(vertex[k], criteria[k]) != view.needsSplit(next, criteria[k]);
        }
    }
    EXPECT_GT(needed, 1000u);
    EXPECT_GT(close, 100u);
}

TEST(Criterion, OfAPictureIsTheSameWithinItAndNeedsLessOutside) {
    const Lattice lattice;
    Camera camera;
    camera.eye = {0, 0, 0};
    camera.target = {100000, 0, 0};
    const View view(camera, {1000, 1000}, lattice);
    const Criterion criterion = criterionOf(view, lattice, 1);
    Criterion all = criterion;
    all.side = {};
    const auto reachOf = [](const Criterion& c, const Vec3d& direction) {
        int32_t far = 0;
        for (int32_t step = 1 << 20; step > 0; step /= 2)
            if (c.needs(Vec3i(direction * double(far + step)), 100, 10, 0)) far += step;
        return far;
    };
    const double edge = std::tan(22.5 / 180 * 3.14159265358979);
    for (const double y : {-1.0, -0.7, 0.0, 0.7, 1.0})
        for (const double z : {-1.0, 0.4, 1.0}) {
            const Vec3d inside(1, 0.99 * edge * y, 0.99 * edge * z);
            EXPECT_EQ(reachOf(criterion, inside), reachOf(all, inside));
        }
    int32_t before = reachOf(all, {1, 0, 0});
    for (const double y : {1.5, 3.0, 100.0}) {
        const int32_t outside = reachOf(criterion, glm::normalize(Vec3d(1, edge * y, 0)));
        EXPECT_LT(outside, before);
        EXPECT_GT(outside, 0);
        before = outside;
    }
    EXPECT_LT(reachOf(criterion, {-1, 0, 0}), reachOf(all, {-1, 0, 0}) / 4);
}

uint64_t hashOf(const ActiveMesh& mesh) {
    uint64_t hash = mesh.vertexCount();
    const auto add = [&](const auto& array) {
        hash = hashBytes(array.data(), array.size() * sizeof(array[0]), hash);
    };
    add(mesh.vertex);
    add(mesh.face);
    add(mesh.pulse);
    add(mesh.record);
    add(mesh.criteria);
    return hash;
}

TEST(Adaption, HasTheSameArraysForAnyNumberOfThreads) {
    const Built built = buildFor(onLattice(dented(test::sphereShape(60), 0.002), 20000));
    std::vector<uint64_t> expected;
    for (const int jobs : {1, 2, 7}) {
        const ThreadLimit limit(jobs);
        Adaption adaption(built.mesh);
        std::mt19937 random(14);
        std::vector<uint64_t> hashes;
        for (int i = 0; i < 12; ++i) {
            const Criterion view = randomView(random, built.input);
            for (int pass = 0; pass < 6; ++pass) {
                adaption.pass(view);
                hashes.push_back(hashOf(adaption.mesh()));
            }
        }
        if (jobs == 1) expected = hashes;
        EXPECT_EQ(hashes, expected);
    }
}

/// Negative control: where a needed operation may hide below one that is not, what comes out
/// depends on what was before.
TEST(Adaption, DependsOnHistoryWhereErrorsAreNotSaturated) {
    Built built = buildFor(onLattice(dented(test::sphereShape(24), 0.01), 3000));
    std::mt19937 random(15);
    for (Operation& o : built.mesh.operation)
        o.error = uint8_t(std::max(int(o.error) - int(random() % 8), 1));
    Adaption coarse(built.mesh), fine(built.mesh);
    int differ = 0;
    for (int i = 0; i < 10; ++i) {
        const Criterion view = randomView(random, built.input);
        coarse.settle(nothing());
        fine.settle(everything());
        coarse.settle(view);
        fine.settle(view);
        differ += applied(coarse.mesh()) != applied(fine.mesh());
    }
    EXPECT_GT(differ, 0);
}

/// A part of it, with its slivers.
TEST(Adaption, OfTheDragonGoesThereAndBack) {
    const std::filesystem::path path =
        test::sharedFolder() / "data" / "scans" / "dragon_vrip.ply.gz";
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no shared data";
    Budget budget(size_t(2) << 30);
    TempSpace space{testing::TempDir(), &budget, size_t(64) << 20};
    Progress progress;
    Built built;
    WholeMesh whole = readWholeMesh(*openSource({path}), path, {}, space, progress);
    const uint32_t triangles = 80'000;
    whole.mesh.edge_class.resize(whole.mesh.triangleCount());
    Mesh part = test::extract(whole.mesh, [&](uint32_t t) { return t < triangles; });
    built.mesh = fromNodes(buildInCore(std::move(part), whole.lattice, budget, &built.counts));
    EXPECT_EQ(validate(built.mesh), "");
    EXPECT_LT(built.counts.levels, 300u);
    EXPECT_GT(built.counts.dummies, 500u);
    Adaption adaption(built.mesh);
    adaption.settle(everything());
    EXPECT_EQ(adaption.mesh().faceCount(), triangles);
    adaption.settle(nothing());
    const ActiveMesh base(built.mesh);
    EXPECT_EQ(adaption.mesh().vertex, base.vertex);
    EXPECT_EQ(adaption.mesh().face, base.face);
}

}  // namespace
}  // namespace pietra::pmesh
