// Adaption on the GPU: its arrays are those of the CPU.

#include "methods/pmesh/gl/gl_adaption.h"

#include <cstring>
#include <string_view>

#include "gpu/test_context.h"
#include "methods/pmesh/pmesh_testing.h"

namespace pietra::pmesh {
namespace {

void expectEqual(GlAdaption& gl, const Adaption& cpu) {
    ActiveMesh mesh(cpu.mesh().source());
    gl.download(mesh);
    const ActiveMesh& expected = cpu.mesh();
    const auto same = [](const char* name, const auto& a, const auto& b) {
        ASSERT_EQ(a.size(), b.size()) << name;
        for (size_t i = 0; i < a.size(); ++i)
            ASSERT_EQ(std::memcmp(&a[i], &b[i], sizeof a[i]), 0) << name << " " << i;
    };
    same("vertex", mesh.vertex, expected.vertex);
    same("pulse", mesh.pulse, expected.pulse);
    same("criteria", mesh.criteria, expected.criteria);
    same("record", mesh.record, expected.record);
    same("face", mesh.face, expected.face);
}

std::vector<TestMesh> meshes() {
    std::vector<TestMesh> meshes = testMeshes();
    std::erase_if(meshes, [](const TestMesh& m) {  // without operations
        return std::string_view(m.name) == "dust" || std::string_view(m.name) == "soup";
    });
    meshes.push_back({"close_rows", [] { return onLattice(closeRows(48), 1 << 20); }});
    return meshes;
}

class GlAdapted : public GlTest, public testing::WithParamInterface<TestMesh> {};
INSTANTIATE_TEST_SUITE_P(Pmesh, GlAdapted, testing::ValuesIn(meshes()),
                         [](const auto& test) { return std::string(test.param.name); });

TEST_P(GlAdapted, HasTheArraysOfTheCpuAfterEachFrame) {
    const Built built = buildFor(GetParam().make());
    Adaption cpu(built.mesh);
    GlAdaption gl(built.mesh, 8);
    expectEqual(gl, cpu);
    std::mt19937 random(21);
    for (int i = 0; i < 60 && !testing::Test::HasFailure(); ++i) {
        const Criterion view = i % 10 == 4   ? everything()
                               : i % 10 == 9 ? nothing()
                                             : randomView(random, built.input);
        const int most_passes = int(1 + random() % 6);
        const PassCounts counts = i % 5 == 0 ? cpu.settle(view) : cpu.frame(view, most_passes);
        PassCounts gl_counts;
        if (i % 5 == 0) {
            gl_counts = gl.settle(view);
        } else {
            gl.frame(view, most_passes);
            gl_counts = gl.lastCounts();
        }
        EXPECT_EQ(gl_counts.splits, counts.splits) << i;
        EXPECT_EQ(gl_counts.merges, counts.merges) << i;
        EXPECT_EQ(gl_counts.passes, counts.passes) << i;
        expectEqual(gl, cpu);
    }
}

}  // namespace
}  // namespace pietra::pmesh
