// The progressive mesh as a data structure: what is built, refined and coarsened again.

#include <fmt/format.h>

#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

class EachMesh : public testing::TestWithParam<TestMesh> {};
INSTANTIATE_TEST_SUITE_P(Pmesh, EachMesh, testing::ValuesIn(testMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

/// Refines by single operations in their order.
void refineInOrder(ActiveMesh& mesh) {
    std::map<OperationId, uint32_t> waiting;
    const auto wait = [&](uint32_t v) {
        if (mesh.record[v].next != kNoOperation) waiting[mesh.record[v].next] = v;
    };
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) wait(v);
    for (const OperationId id : coarseToFine(mesh.source())) {
        const uint32_t v = waiting.at(id);
        const size_t before = mesh.vertexCount();
        ASSERT_TRUE(mesh.apply(v));
        wait(v);
        if (mesh.vertexCount() > before) wait(uint32_t(before));
    }
}

void expectIsInput(const ActiveMesh& mesh, const Built& built) {
    std::vector<Triangle> expected;
    for (Triangle t : built.input.triangle) {
        for (uint32_t& v : t) v = built.counts.name_of[v];
        std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
        expected.push_back(t);
    }
    std::sort(expected.begin(), expected.end());
    EXPECT_EQ(namedTriangles(mesh), expected);
    std::map<uint32_t, Vec3i> position;
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v)
        position[mesh.pulse[v].name] = mesh.vertex[v].position();
    for (size_t v = 0; v < built.input.vertexCount(); ++v) {
        const Vec3i off = glm::abs(position[built.counts.name_of[v]] - built.input.position[v]);
        EXPECT_LE(uint32_t(std::max({off.x, off.y, off.z})), built.counts.largest_error);
    }
}

void expectEnclosed(const ActiveMesh& mesh, uint32_t v, const NormalBox& box) {
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) {
        std::array<Vec3d, 3> at;
        bool is_around = false;
        for (uint32_t k = 0; k < 3; ++k) {
            at[k] = Vec3d(mesh.vertex[mesh.vertexAt(4 * f + k)].position());
            is_around |= mesh.vertexAt(4 * f + k) == v;
        }
        NormalBox one = NormalBox::none();
        one.add(glm::cross(at[1] - at[0], at[2] - at[0]));
        if (is_around && !one.empty()) {
            ASSERT_TRUE(box.encloses(one)) << f;
        }
    }
}

/// Where nothing is rounded: of all faces that a split finds and makes.
TEST(PmeshBuild, BoxesHoldTheNormalsOfAllFaces) {
    for (const test::Shape& shape :
         {dented(test::sphereShape(10), 0.01), test::gridShape(14, 0.1)}) {
        const Built built = buildFor(onLattice(shape, 120));
        ActiveMesh mesh(built.mesh);
        std::map<OperationId, uint32_t> waiting;
        const auto wait = [&](uint32_t v) {
            if (mesh.record[v].next != kNoOperation) waiting[mesh.record[v].next] = v;
        };
        for (uint32_t v = 0; v < mesh.vertexCount(); ++v) wait(v);
        for (const OperationId id : coarseToFine(built.mesh)) {
            const uint32_t v = waiting.at(id), u = uint32_t(mesh.vertexCount());
            const Operation& o = built.mesh.operation[id];
            ASSERT_EQ(o.shift, 0);
            ASSERT_NO_FATAL_FAILURE(expectEnclosed(mesh, v, o.normals));
            ASSERT_TRUE(mesh.apply(v));
            wait(v);
            wait(u);
            for (const uint32_t end : {v, u})
                ASSERT_NO_FATAL_FAILURE(expectEnclosed(mesh, end, o.normals));
        }
    }
}

TEST_P(EachMesh, RefinedInOrderItIsTheInput) {
    const Built built = buildFor(GetParam().make());
    EXPECT_EQ(validate(built.mesh), "");
    EXPECT_EQ(validateStars(built.mesh), "");
    ActiveMesh mesh(built.mesh);
    expectSound(mesh);
    refineInOrder(mesh);
    expectSound(mesh);
    expectIsInput(mesh, built);
}

TEST_P(EachMesh, RefinedInParallelItIsTheInputAndCoarsenedTheBaseBitForBit) {
    const Built built = buildFor(GetParam().make());
    Adaption adaption(built.mesh);
    adaption.settle(everything());
    expectSound(adaption.mesh());
    expectIsInput(adaption.mesh(), built);
    adaption.settle(nothing());
    const ActiveMesh base(built.mesh);
    EXPECT_EQ(adaption.mesh().vertex, base.vertex);
    EXPECT_EQ(adaption.mesh().face, base.face);
}

TEST_P(EachMesh, OnlyWhatMustStaysInTheBase) {
    const Built built = buildFor(GetParam().make());
    const std::map<std::string, size_t> most{
        {"ball", 4},     {"fine_ball", 4}, {"bordered", 4}, {"non_manifold", 200},
        {"bow_tie", 14}, {"dust", 240},    {"soup", 600}};
    EXPECT_LE(built.mesh.base_vertex.size(), most.at(GetParam().name));
}

TEST_P(EachMesh, TheSameBytesAgain) {
    const Mesh input = GetParam().make();
    const Built a = buildFor(input), b = buildFor(input);
    EXPECT_EQ(a.mesh.base_vertex, b.mesh.base_vertex);
    EXPECT_EQ(a.mesh.operation, b.mesh.operation);
    EXPECT_EQ(a.forest.row, b.forest.row);
}

TEST(PmeshCodes, RoundUpAndAreMonotone) {
    for (const uint64_t value : {0ull, 1ull, 7ull, 8ull, 9ull, 15ull, 16ull, 17ull, 1000ull,
                                 4095ull, 4096ull, 4097ull, (1ull << 27) - 1, 1ull << 27}) {
        const uint32_t e = encodeRoundedUp<3>(value), r = encodeRoundedUp<11>(value);
        EXPECT_GE(decodeRounded<3>(e), value);
        EXPECT_GE(decodeRounded<11>(r), value);
        EXPECT_TRUE(e == 0 || decodeRounded<3>(e - 1) < value);
        EXPECT_TRUE(r == 0 || decodeRounded<11>(r - 1) < value);
    }
    for (uint32_t code = 1; code < 256; ++code) EXPECT_LT(decodeError(code - 1), decodeError(code));
    for (uint32_t code = 1; code <= kMaxRadiusCode; ++code)
        EXPECT_LT(decodeRadius(code - 1), decodeRadius(code));
}

TEST(PmeshCodes, BoxesEncloseTheirNormals) {
    std::mt19937 random(5);
    std::normal_distribution<double> any;
    for (int i = 0; i < 1000; ++i) {
        NormalBox box = NormalBox::none(), sum = NormalBox::none();
        EXPECT_TRUE(box.empty());
        for (int j = 0; j < 1 + i % 3; ++j) {
            const Vec3d d = std::exp2(any(random)) * Vec3d(any(random), any(random), any(random));
            NormalBox one = NormalBox::none();
            one.add(d);
            box.add(d);
            sum.add(one);
            const Vec3d n = double(NormalBox::kUnit) * glm::normalize(d);
            for (int k = 0; k < 3; ++k) {
                EXPECT_LE(box.low(size_t(k)), n[k]);
                EXPECT_GE(box.high(size_t(k)), n[k]);
                EXPECT_LE(one.high(size_t(k)) - one.low(size_t(k)), 1);
            }
            EXPECT_TRUE(box.encloses(one) && NormalBox().encloses(box));
        }
        EXPECT_EQ(box, sum);
        EXPECT_EQ(NormalBox::ofBits(box.word()), box);
        double longest = 0;
        for (uint32_t corner = 0; corner < 8; ++corner) {
            Vec3d p;
            for (uint32_t k = 0; k < 3; ++k) p[int(k)] = corner >> k & 1 ? box.low(k) : box.high(k);
            longest = std::max(longest, glm::length(p));
        }
        EXPECT_GE(box.word() >> 24, 2 * longest);
        EXPECT_LT(box.word() >> 24, 2 * longest + 1);
    }
    NormalBox flat = NormalBox::none();
    flat.add(Vec3d(0, 0, 0));
    EXPECT_TRUE(flat.empty());
    flat.add(Vec3d(0, 0, -3));
    EXPECT_EQ(flat.low(0), 0);
    EXPECT_EQ(flat.high(2), -7);
}

TEST(PmeshCodes, NormalsKeepTheirBytes) {
    for (uint32_t packed = 0; packed < 65536; ++packed) {
        if ((packed & 0xff) == 0x80 || packed >> 8 == 0x80) continue;  // -128 is no coordinate
        EXPECT_EQ(packNormal(unpackNormal(packed)), packed);
    }
}

TEST(PmeshCodes, OffsetsLoseAtMostHalfAStepOfTheirShift) {
    std::mt19937 random(5);
    for (int i = 0; i < 10000; ++i) {
        std::array<Vec3i, 2> offset;
        const int32_t range = 2 << (random() % 21);
        for (Vec3i& d : offset)
            for (int k = 0; k < 3; ++k) d[k] = int32_t(random() % uint32_t(range)) - range / 2;
        const QuantisedOffsets q = quantiseOffsets(offset);
        int32_t largest = 0;
        for (size_t end = 0; end < 2; ++end)
            for (int k = 0; k < 3; ++k) {
                const int32_t value = q.delta[end][size_t(k)] * (1 << q.shift);
                EXPECT_LE(2 * std::abs(value - offset[end][k]), 1 << q.shift);
                largest = std::max(largest, std::abs(offset[end][k]));
            }
        EXPECT_TRUE(q.shift == 0 || largest >= 127 << (q.shift - 1));
    }
}

TEST(PmeshBuild, DummiesMoveWhatWouldBeTooCoarse) {
    const Built built = buildFor(onLattice(closeRows(24), 1 << 20));
    EXPECT_GT(built.counts.dummies, 0u);
    EXPECT_EQ(validate(built.mesh), "");
}

TEST(PmeshBuild, SaysHowMuchMemoryItNeeds) {
    Budget budget(1 << 20);
    const Mesh mesh = onLattice(test::sphereShape(40), 4000);
    try {
        buildInCore(mesh, Lattice{}, budget);
        FAIL();
    } catch (const std::exception& e) {
        EXPECT_EQ(std::string(e.what()),
                  "a progressive mesh, built in memory, needs 14.6 MiB, but only 1.0 MiB of the "
                  "memory limit are left");
    }
}

class DamagedMesh : public testing::Test {
public:
    Built built_ = buildFor(onLattice(dented(test::sphereShape(8), 0.01), 900));
    ProgressiveMesh& mesh_ = built_.mesh;
};

TEST_F(DamagedMesh, IsRefusedWithAMessage) {
    const auto expect = [&](const std::string& message, const auto& damage) {
        ProgressiveMesh damaged = mesh_;
        damage(damaged);
        EXPECT_EQ(validate(damaged), message);
    };
    expect("", [](ProgressiveMesh&) {});
    expect("operation 3: its level is 1023, the largest is 1022",
           [](ProgressiveMesh& m) { m.operation[3].level = 1023; });
    expect("operation 5: its neighbours have equal ranks",
           [](ProgressiveMesh& m) { m.operation[5].ranks = 0x33; });
    expect("operation 7: its deltas are shifted by 21",
           [](ProgressiveMesh& m) { m.operation[7].shift = 21; });
    expect("operation 0: not a tree", [](ProgressiveMesh& m) { m.operation.back().child[0] = 0; });
    expect("base vertex 99999 is not there",
           [](ProgressiveMesh& m) { m.base_triangle[0][1] = 99999; });
    const OperationId last = OperationId(mesh_.operation.size() - 1);
    expect(fmt::format("operation {}: no parent", last), [](ProgressiveMesh& m) {
        for (Operation& o : m.operation)
            for (OperationId& c : o.child)
                if (c == m.operation.size() - 1) c = kNoOperation;
    });
    expect(fmt::format("operation {}: its criteria exceed its parent's", last),
           [](ProgressiveMesh& m) { m.operation.back().error = 255; });
    expect(fmt::format("operation {}: its criteria exceed its parent's", last),
           [](ProgressiveMesh& m) { m.operation.back().normals = NormalBox(); });
    expect(fmt::format("operation {}: its box of normals is empty", last),
           [](ProgressiveMesh& m) { m.operation.back().normals = NormalBox::none(); });
}

TEST_F(DamagedMesh, IsRefusedWhereStarsDoNotFit) {
    const auto expect = [&](const std::string& message, const auto& damage) {
        ProgressiveMesh damaged = mesh_;
        damage(damaged);
        EXPECT_EQ(validate(damaged), "");
        EXPECT_EQ(validateStars(damaged), message);
    };
    expect("", [](ProgressiveMesh&) {});
    expect("operation 9: its ranks do not fit its star",
           [](ProgressiveMesh& m) { m.operation[9].ranks = 0x1e; });
    expect("operation 9: its ranks do not fit its star",
           [](ProgressiveMesh& m) { m.operation[9].ranks = 0xf1; });
    expect(fmt::format("operation {}: its vertex has no triangles", coarseToFine(mesh_)[0]),
           [](ProgressiveMesh& m) { m.base_triangle.clear(); });
    expect("operation 0: a neighbour does not split after it", [](ProgressiveMesh& m) {
        for (const OperationId o : m.base_operation)
            if (o != kNoOperation) m.operation[o].level = 0;
    });
}

}  // namespace
}  // namespace pietra::pmesh
