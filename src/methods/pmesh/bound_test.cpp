// The errors that are stated, against the truth: exact distances of samples, both ways, of cuts as
// they are read from a file.

#include <gtest/gtest.h>

#include <filesystem>
#include <random>

#include "io/triangle_source.h"
#include "methods/pmesh/pmesh_testing.h"
#include "methods/pmesh/split_model.h"
#include "methods/pmesh/whole_mesh.h"
#include "simplify/deviation_testing.h"

namespace pietra::pmesh {
namespace {

constexpr uint64_t kSamples = 5'000;  // of each mesh, each way

/// What is measured over what is stated: the largest of the samples of one cut.
struct Ratios {
    double mesh_to_input = 0;  ///< each point by the triangle that it is of
    double input_to_mesh = 0;  ///< by the whole cut
    double largest() const { return std::max(mesh_to_input, input_to_mesh); }
};

/// Random points, corners among them; of meshes of many triangles, of every n-th.
template <class Sample>
void sample(const Mesh& mesh, std::mt19937& random, Sample&& take) {
    const uint64_t count = mesh.triangleCount();
    const uint64_t each = std::clamp<uint64_t>(kSamples / count, 3, 100);
    const uint64_t stride = 1 + count * each / (2 * kSamples);
    std::uniform_real_distribution<double> part(0, 1);
    for (uint64_t t = random() % stride; t < count; t += stride)
        for (uint64_t i = 0; i < each; ++i) {
            double a = part(random), b = part(random);
            if (a + b > 1) a = 1 - a, b = 1 - b;
            if (i == 0) a = b = 0;
            const Triangle& f = mesh.triangle[t];
            const Vec3d p(mesh.position[f[0]]);
            take(p + a * (Vec3d(mesh.position[f[1]]) - p) + b * (Vec3d(mesh.position[f[2]]) - p),
                 t);
        }
}

class BoundsOf {
public:
    BoundsOf(const Mesh& input, uint32_t leaf_triangles) : input_(input) {
        const std::string path = ::testing::TempDir() + "/pmesh-bound-test.pietra";
        buildFile(input, leaf_triangles, path);
        reader_ = std::make_unique<ModelReader>(path);
        model_ = openModel(*reader_);
        std::filesystem::remove(path);
        const Lattice& lattice = reader_->info().lattice;
        // Where the lattice has it.
        for (Vec3i& p : input_.position)
            p = Vec3i(glm::round((Vec3d(p) - lattice.toInput(Vec3i(0))) / lattice.step));
        oracle_ = std::make_unique<pietra::testing::DistanceOracle>(input_);
    }

    /// Of cuts by error and by view, in turn.
    double largestRatio(int cuts) {
        double largest = 0;
        for (int i = 0; i < cuts; ++i) largest = std::max(largest, measure(i).largest());
        return largest;
    }

private:
    CutRequest request(int i) {
        CutRequest request;
        double error = 0;
        for (const Node& node : reader_->nodes()) error = std::max(error, double(node.error));
        if (i % 2 == 0) {
            request.max_error = std::ldexp(error, -i - 1);
            return request;
        }
        const ModelInfo& info = reader_->info();
        std::uniform_real_distribution<double> place(-0.5, 1.5);
        const Vec3d low = info.lattice.toInput(info.bounds.min);
        const Vec3d size = info.lattice.toInput(info.bounds.max) - low;
        Camera camera;
        camera.target = low + 0.5 * size;
        for (int k = 0; k < 3; ++k) camera.eye[k] = low[k] + size[k] * place(random_);
        request.view.emplace(camera, PictureSize{}, info.lattice);
        request.pixels = std::exp2(std::uniform_real_distribution<double>(0, 5)(random_));
        return request;
    }

    Ratios measure(int i) {
        const MeshCut cut = model_->cut(request(i), budget_);
        Ratios ratios;
        const auto compare = [](double& largest, const pietra::testing::DistanceOracle& mesh,
                                const Vec3d& p, double stated) {
            stated += 1e-9;
            largest = std::max(largest, mesh.nearest(p, largest * stated).distance / stated);
        };
        sample(cut.mesh, random_, [&](const Vec3d& p, uint64_t t) {
            compare(ratios.mesh_to_input, *oracle_, p, cut.error[t]);
        });
        const pietra::testing::DistanceOracle cut_oracle(cut.mesh);
        sample(input_, random_, [&](const Vec3d& p, uint64_t) {
            compare(ratios.input_to_mesh, cut_oracle, p, cut.max_error);
        });
        return ratios;
    }

    Mesh input_;
    Budget budget_{size_t(512) << 20};
    std::mt19937 random_{23};
    std::unique_ptr<ModelReader> reader_;
    std::unique_ptr<AdaptiveModel> model_;
    std::unique_ptr<pietra::testing::DistanceOracle> oracle_;
};

class MeshBounded : public ::testing::TestWithParam<TestMesh> {};

TEST_P(MeshBounded, IsWithinWhatIsStated) {
    EXPECT_LE(BoundsOf(GetParam().make(), 64).largestRatio(8), 1);
}

INSTANTIATE_TEST_SUITE_P(Pmesh, MeshBounded, ::testing::ValuesIn(testMeshes()),
                         [](const auto& test) { return std::string(test.param.name); });

class RealMeshBounded : public ::testing::TestWithParam<const char*> {};

/// A quarter of it would be found out: so this test can fail, and bounds are not far too large.
TEST_P(RealMeshBounded, IsWithinWhatIsStatedButNotAQuarterOfIt) {
    const std::filesystem::path path = test::sharedFolder() / "data" / GetParam();
    if (!std::filesystem::exists(path)) GTEST_SKIP() << "no shared data";
    Budget budget(size_t(1) << 30);
    TempSpace space{::testing::TempDir(), &budget, size_t(64) << 20};
    Progress progress;
    WholeMesh whole = readWholeMesh(*openSource({path}), path, {}, space, progress);
    for (Vec3i& p : whole.mesh.position) p = p >> whole.lattice.shift;
    BoundsOf bounds(whole.mesh, 4000);
    const double ratio = bounds.largestRatio(4);
    EXPECT_LE(ratio, 1);
    EXPECT_GT(4 * ratio, 1);
}

INSTANTIATE_TEST_SUITE_P(Pmesh, RealMeshBounded,
                         ::testing::Values("scans/armadillo_86k.obj", "cad/counter.unitsmm.STL",
                                           "dirty/snowden_bust.ply", "dirty/Grey_Nurse_Shark.stl"),
                         [](const auto& test) {
                             std::string name = std::filesystem::path(test.param).stem().string();
                             std::erase_if(name, [](char c) { return !std::isalnum(c); });
                             return name;
                         });

}  // namespace
}  // namespace pietra::pmesh
