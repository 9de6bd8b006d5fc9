// What every method promises, for every kind of input. A new method is tested here as soon as it
// stands in the method table.

#include <fmt/format.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cmath>
#include <filesystem>
#include <fstream>
#include <optional>
#include <set>

#include "audit/adaptive_check.h"
#include "audit/certificate.h"
#include "audit/cracks.h"
#include "audit/mesh_topology.h"
#include "base/error.h"
#include "base/scratch_directory.h"
#include "methods/method_table.h"
#include "multires/cut.h"
#include "render/offline/offline_picture.h"
#include "runtime/eye_side.h"
#include "runtime/patch_reader.h"
#include "store/model_reader.h"
#include "store/verify.h"
#include "tests/conformance/meshes.h"

namespace pietra {
namespace {

namespace fs = std::filesystem;

std::string bytesOf(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

const std::vector<ConformanceMesh>& meshes() {
    static const std::vector<ConformanceMesh> all = {closedMesh(45), borderedMesh(110),
                                                     nonManifoldMesh(), dustMesh(6000)};
    return all;
}

/// In patches so small that there are several levels.
BuildReport buildSmall(const Method& method, TriangleSource& source,
                       const ScratchDirectory& scratch, const std::string& name, int jobs,
                       size_t memory) {
    BuildSettings settings;
    settings.output = scratch.file(name);
    settings.force = true;
    settings.memory_bytes = memory;
    settings.jobs = jobs;
    settings.temp_dir = scratch.path();
    settings.leaf_triangles = 700;
    settings.patch_triangles = 500;
    settings.input_name = name;
    Progress progress;
    return method.build(source, settings, progress);
}

PatchStream streamOf(const ModelReader& model) {
    return [&model](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
        visitPatches(model, nodes, visit);
    };
}

class Conformance : public testing::TestWithParam<std::tuple<size_t, size_t>> {
protected:
    const Method& method() const { return methods()[std::get<0>(GetParam())]; }
    const ConformanceMesh& mesh() const { return meshes()[std::get<1>(GetParam())]; }
    /// Adaptive methods keep all components of a model, however small.
    bool hasLevels() const { return !method().open || mesh().name != "dust"; }

    BuildReport build(const std::string& name, int jobs = 2, size_t memory = size_t(1) << 30) {
        return buildSmall(method(), *mesh().source(), scratch_, name, jobs, memory);
    }

    VerifyReport verify(const ModelReader& model) const {
        Progress progress;
        const auto adaptive = openAdaptive(model);
        if (!adaptive) return verifyModel(model, progress);
        return verifyModel(model, progress,
                           [&](uint32_t page) { return adaptive->pageFault(page); });
    }

    const ScratchDirectory scratch_;
    Budget budget_{size_t(512) << 20};
};

/// Whose pages are patches, and whose are not.
class PatchConformance : public Conformance {};
class AdaptiveConformance : public Conformance {
protected:
    void SetUp() override {
        build("model");
        model_.emplace(scratch_.file("model"));
        adaptive_ = openAdaptive(*model_);
    }
    Mesh cut(const CutRequest& request) { return adaptive_->cut(request, budget_).mesh; }
    Mesh coarsest() {
        CutRequest request;
        request.max_triangles = 0;
        return cut(request);
    }

    std::optional<ModelReader> model_;
    std::unique_ptr<AdaptiveModel> adaptive_;
};

std::vector<size_t> methodsThat(bool have_patches) {
    std::vector<size_t> indices;
    for (size_t i = 0; i < methods().size(); ++i)
        if ((methods()[i].open == nullptr) == have_patches) indices.push_back(i);
    return indices;
}

std::string parameterName(const testing::TestParamInfo<std::tuple<size_t, size_t>>& info) {
    std::string name = std::string(methods()[std::get<0>(info.param)].name) + "_" +
                       meshes()[std::get<1>(info.param)].name;
    std::replace(name.begin(), name.end(), '-', '_');
    return name;
}

INSTANTIATE_TEST_SUITE_P(AllMethods, Conformance,
                         testing::Combine(testing::Range(size_t(0), methods().size()),
                                          testing::Range(size_t(0), size_t(4))),
                         parameterName);
INSTANTIATE_TEST_SUITE_P(AllMethods, PatchConformance,
                         testing::Combine(testing::ValuesIn(methodsThat(true)),
                                          testing::Range(size_t(0), size_t(4))),
                         parameterName);
INSTANTIATE_TEST_SUITE_P(AllMethods, AdaptiveConformance,
                         testing::Combine(testing::ValuesIn(methodsThat(false)),
                                          testing::Range(size_t(0), size_t(4))),
                         parameterName);

TEST_P(Conformance, errorsAreMonotoneAndBoundsNested) {
    build("model");
    const ModelReader model(scratch_.file("model"));
    const VerifyReport report = verify(model);
    EXPECT_TRUE(report.ok()) << (report.faults.empty() ? "" : report.faults[0]);
    EXPECT_EQ(report.pages.checked, model.pageCount());
    if (hasLevels()) {
        EXPECT_GT(model.info().levels, 3u);
    }
    EXPECT_LE(rootCut(model.nodes()).triangles, 1500u);
}

TEST_P(PatchConformance, anyValidCutIsCrackFree) {
    build("model");
    const ModelReader model(scratch_.file("model"));
    std::set<uint64_t> sizes;
    for (uint64_t seed = 0; seed < 40; ++seed) {
        const Cut cut = randomCut(model.nodes(), seed);
        sizes.insert(cut.triangles);
        const CrackReport report =
            countCracks(streamOf(model), cut.nodes, budget_, size_t(16) << 20, scratch_.path());
        EXPECT_TRUE(report.ok()) << "cut " << seed << ": " << report.cracked_edges << " cracked, "
                                 << report.overlapping_edges << " overlapping, "
                                 << report.miscounted_edges << " miscounted, "
                                 << report.disagreeing_edges << " disagreeing";
    }
    EXPECT_GT(sizes.size(), 10u);
}

TEST_P(PatchConformance, finestCutIsTheInput) {
    const BuildReport report = build("model");
    const ModelReader model(scratch_.file("model"));
    const Lattice& lattice = model.info().lattice;
    using Key = std::array<uint64_t, 3>;
    const auto sorted = [](Key key) {
        std::sort(key.begin(), key.end());
        return key;
    };
    std::set<Key> expected, found;
    for (const auto& t : mesh().triangles) {
        Key key;
        for (size_t k = 0; k < 3; ++k) {
            key[k] = latticeKey(lattice.snap(mesh().vertices.position[t[k]]));
        }
        key = sorted(key);
        if (key[0] != key[1] && key[1] != key[2]) expected.insert(key);
    }
    std::mutex mutex;
    const Cut finest = finestCut(model.nodes());
    visitPatches(model, finest.nodes, [&](NodeIndex, const Mesh& patch) {
        const std::lock_guard lock(mutex);
        for (const Triangle& t : patch.triangle) {
            Key key;
            for (size_t k = 0; k < 3; ++k) key[k] = latticeKey(patch.position[t[k]]);
            EXPECT_TRUE(found.insert(sorted(key)).second);
        }
    });
    EXPECT_EQ(found, expected);
    EXPECT_EQ(report.input_triangles, mesh().triangles.size());
    EXPECT_EQ(report.input_triangles - report.dropped_degenerate - report.dropped_duplicate,
              expected.size());
}

TEST_P(Conformance, bytesDoNotDependOnThreadsOrMemory) {
    build("one", 1);
    const std::string one = bytesOf(scratch_.file("one"));
    EXPECT_FALSE(one.empty());
    for (const int jobs : {2, 7}) {
        build("more", jobs);
        EXPECT_TRUE(bytesOf(scratch_.file("more")) == one) << jobs << " threads";
    }
    build("little", 2, size_t(96) << 20);
    EXPECT_TRUE(bytesOf(scratch_.file("little")) == one);
}

TEST_P(PatchConformance, statedErrorsHoldAgainstTheFinestCut) {
    build("model");
    const ModelReader model(scratch_.file("model"));
    std::vector<Cut> cuts = {rootCut(model.nodes())};
    for (uint64_t seed = 0; seed < 6; ++seed) cuts.push_back(randomCut(model.nodes(), seed));
    const PatchStream stream = streamOf(model);
    CertificateOptions options;
    options.samples = 300'000;
    const auto reports = auditCertificate(
        model.nodes(), cuts, stream, truthOfFinestCut(model.nodes(), stream), options, budget_);
    for (const CertificateReport& report : reports) {
        EXPECT_EQ(report.violations(), 0u) << report.worstRatio();
        EXPECT_GT(report.samples(), 1000u);
    }
    EXPECT_GT(reports[0].worstRatio(), 0.15);  // a bound, but no idle one
}

TEST_P(PatchConformance, fromWithinNothingIsCulled) {
    build("model");
    const ModelReader model(scratch_.file("model"));
    const Box3i& box = model.info().bounds;
    const Vec3d low = model.info().lattice.toInput(box.min),
                high = model.info().lattice.toInput(box.max);
    Camera camera;
    camera.target = high;
    camera.eye = (low + high) * 0.5;
    const bool closed = mesh().name == "closed";
    EXPECT_EQ(eyeMayBeInside(model, View(camera, {64, 64}, model.info().lattice)), closed);
    Progress progress;
    const ModelReader* scene[] = {&model};
    OfflineSettings settings;
    settings.culling = {true, true, true};
    const OfflineStatistics drawn =
        drawModels(scene, camera, {64, 64}, settings, progress).statistics;
    if (closed) {
        EXPECT_EQ(drawn.pixels_covered, 64u * 64u);
    }
    camera.eye = high + (high - low);
    EXPECT_FALSE(eyeMayBeInside(model, View(camera, {64, 64}, model.info().lattice)));
}

TEST_P(Conformance, damageIsFound) {
    build("model");
    const std::string whole = bytesOf(scratch_.file("model"));
    const auto rejected = [&](const std::string& bytes) {
        std::ofstream(scratch_.file("bad"), std::ios::binary) << bytes;
        try {
            const ModelReader model(scratch_.file("bad"));
            return !verify(model).ok();
        } catch (const InputError&) {
            return true;
        }
    };
    EXPECT_FALSE(rejected(whole));
    for (size_t part = 0; part < 20; ++part) {
        EXPECT_TRUE(rejected(whole.substr(0, whole.size() * part / 20))) << part;
        std::string flipped = whole;
        const size_t at = mixBits(part) % whole.size();
        flipped[at] = char(flipped[at] ^ (1 << part % 8));
        EXPECT_TRUE(rejected(flipped)) << "byte " << at;
    }
}

TEST_P(AdaptiveConformance, allCutsHaveOneTopology) {
    EXPECT_EQ(adaptive_->modelFault(budget_), "");
    const MeshTopology expected = topologyOf(coarsest());
    std::set<size_t> sizes;
    for (const double pixels : {0.1, 0.5, 2.0, 10.0, 50.0})
        for (const double distance : {0.7, 3.0}) {
            Camera camera;
            camera.target = Vec3d(0.5);
            camera.eye = camera.target + distance * Vec3d(0.3, -0.8, 0.5);
            CutRequest request;
            request.view.emplace(camera, PictureSize{}, model_->info().lattice);
            request.pixels = pixels;
            const Mesh mesh = cut(request);
            sizes.insert(mesh.triangleCount());
            EXPECT_EQ(topologyOf(mesh), expected);
        }
    if (hasLevels()) {
        EXPECT_GT(sizes.size(), 4u);
    }
}

/// Connectivity exactly; places as the quantisation error says.
TEST_P(AdaptiveConformance, theFinestIsTheInput) {
    const ModelInfo& info = model_->info();
    const Mesh finest = cut({});
    EXPECT_EQ(finest.triangleCount(),
              info.input_triangles - info.dropped_degenerate - info.dropped_duplicate);
    std::vector<Vec3d> corners;
    for (const Vec3i& p : finest.position) corners.push_back(Vec3d(p));
    for (const auto& t : mesh().triangles)
        for (const uint64_t v : t) {
            const Vec3d p = info.lattice.toLattice(mesh().vertices.position[v]);
            const auto near = [&](const Vec3d& q) {
                return glm::length(p - q) <= double(info.quantisation_error) * (1 + 1e-6);
            };
            if (std::none_of(corners.begin(), corners.end(), near)) {
                FAIL() << p.x << " " << p.y << " " << p.z;
            }
            if (v > 2000) break;  // quadratic
        }
}

TEST_P(AdaptiveConformance, finerIsNeverCoarser) {
    size_t before = 0;
    double stated_before = HUGE_VAL;
    const double most = rootCut(model_->nodes()).max_error;
    for (double error = most; error > most / 1e4; error /= 3) {
        CutRequest request;
        request.max_error = error;
        const MeshCut found = adaptive_->cut(request, budget_);
        EXPECT_GE(found.mesh.triangleCount(), before);
        EXPECT_LE(found.max_error, stated_before);
        EXPECT_TRUE(found.max_error <= error || found.below_finest);
        before = found.mesh.triangleCount();
        stated_before = found.max_error;
        request = {};
        request.max_triangles = before;
        EXPECT_LE(adaptive_->cut(request, budget_).max_error, found.max_error);
    }
    const size_t least = coarsest().triangleCount();
    CutRequest request;
    request.max_triangles = least;
    EXPECT_EQ(cut(request).triangleCount(), least);
    EXPECT_FALSE(adaptive_->cut(request, budget_).over_budget);
    request.max_triangles = least - 1;
    EXPECT_TRUE(adaptive_->cut(request, budget_).over_budget);
}

TEST_P(AdaptiveConformance, tooLittleMemorySaysHowMuch) {
    Budget little(hasLevels() ? size_t(1) << 16 : 0);
    EXPECT_THROW(adaptive_->cut({}, little), MemoryError);
}

std::string plyOf(TriangleSource& source) {
    std::string vertices, faces;
    VertexBatch positions;
    while (source.readVertices(positions))
        for (const Vec3d& p : positions.position)
            vertices += fmt::format("{} {} {}\n", p.x, p.y, p.z);
    TriangleBatch triangles;
    while (source.readTriangles(triangles))
        for (const auto& t : triangles.triangle)
            faces += fmt::format("3 {} {} {}\n", t[0], t[1], t[2]);
    return fmt::format(
               "ply\nformat ascii 1.0\nelement vertex {}\nproperty double x\nproperty double y\n"
               "property double z\nelement face {}\nproperty list uchar int vertex_indices\n"
               "end_header\n",
               source.vertexCount(), source.triangleCountHint()) +
           vertices + faces;
}

/// Also those inputs that have made builders stumble.
TEST(EveryMethod, passesTheAuditOfEveryInput) {
    for (const Method& method : methods())
        for (const ConformanceInput& input : conformanceInputs()) {
            SCOPED_TRACE(std::string(method.name) + ", " + input.name);
            const ScratchDirectory scratch;
            buildSmall(method, *input.open(), scratch, "model", 2, size_t(256) << 20);
            const ModelReader model(scratch.file("model"));
            Budget budget(size_t(256) << 20);
            Progress progress;
            ModelCheckSettings settings;
            settings.cuts = 12;
            settings.samples = 100'000;
            settings.input = {scratch.write("input.ply", plyOf(*input.open()))};
            settings.temp_dir = scratch.path();
            const auto adaptive = openAdaptive(model);
            const ModelCheckReport report =
                adaptive ? checkAdaptive(model, *adaptive, settings, budget, progress)
                         : checkModel(model, settings, budget, progress);
            EXPECT_TRUE(report.ok()) << (report.faults.empty() ? "" : report.faults[0]);
            EXPECT_TRUE(report.file.ok()) << report.file.faults.size();
        }
}

}  // namespace
}  // namespace pietra
