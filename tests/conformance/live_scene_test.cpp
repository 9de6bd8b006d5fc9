// Models whose pages are not patches, as they are looked at: for every method that has them.

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <optional>
#include <set>
#include <thread>

#include "audit/mesh_topology.h"
#include "base/check.h"
#include "base/error.h"
#include "base/hash.h"
#include "base/scratch_directory.h"
#include "methods/method_table.h"
#include "render/offline/offline_picture.h"
#include "render/raster/rasteriser.h"
#include "runtime/live_settle.h"
#include "runtime/scene.h"
#include "store/model_reader.h"
#include "tests/conformance/meshes.h"

namespace pietra {
namespace {

constexpr PictureSize kSize{320, 256};

void buildModel(const Method& method, const ConformanceMesh& mesh, const ScratchDirectory& scratch,
                const std::string& name) {
    BuildSettings settings;
    settings.output = scratch.file(name);
    settings.force = true;
    settings.memory_bytes = size_t(1) << 30;
    settings.jobs = 2;
    settings.temp_dir = scratch.path();
    settings.leaf_triangles = 700;
    settings.patch_triangles = 500;
    Progress progress;
    method.build(*mesh.source(), settings, progress);
}

/// Frame i of a flight around a mesh in the unit cube, and close to it.
FrameRequest flight(int i, double pixels = 0.25) {
    FrameRequest request;
    const double angle = 0.07 * i, distance = 1.6 + std::sin(0.11 * i);
    request.camera.target = Vec3d(0.5, 0.5, 0.1);
    request.camera.eye = request.camera.target +
                         distance * Vec3d(std::cos(angle), std::sin(angle), 0.4 + 0.3 * distance);
    request.camera.up = {0, 0, 1};
    request.size = kSize;
    request.pixels = pixels;
    request.seconds = i / 60.0;
    request.culling = {};
    return request;
}

/// As one mesh again: vertices are where they lie.
Mesh welded(std::span<const DrawPatch> patches) {
    Mesh mesh;
    std::map<uint64_t, uint32_t> index;
    for (const DrawPatch& patch : patches)
        for (const Triangle& t : patch.mesh->triangle) {
            Triangle corners;
            for (size_t k = 0; k < 3; ++k) {
                const Vec3i& p = patch.mesh->position[t[k]];
                const auto [found, is_new] =
                    index.try_emplace(latticeKey(p), uint32_t(mesh.vertexCount()));
                if (is_new) mesh.position.push_back(p);
                corners[k] = found->second;
            }
            mesh.triangle.push_back(corners);
        }
    mesh.edge_class.assign(mesh.triangleCount(), 0);
    return mesh;
}

Picture draw(std::span<const ModelPatches> models) {
    Rasteriser rasteriser(models[0].view, *models[0].lattice, 1, {});
    rasteriser.draw(models, false);
    return rasteriser.finish();
}

/// The same pixels, as near; depths are rounded by the order of a triangle's corners.
void expectSame(const Picture& a, const Picture& b) {
    ASSERT_EQ(a.pixelCount(), b.pixelCount());
    size_t covered = 0, other_coverage = 0, other_depth = 0;
    for (size_t i = 0; i < a.pixelCount(); ++i) {
        const bool is_covered = std::isfinite(a.depth[i]);
        covered += is_covered;
        other_coverage += is_covered != std::isfinite(b.depth[i]);
        other_depth += is_covered && !(std::abs(a.depth[i] - b.depth[i]) <= 1e-4f * a.depth[i]);
    }
    EXPECT_GT(covered, 1000u);
    EXPECT_EQ(other_coverage, 0u);
    EXPECT_LE(other_depth, covered / 10000);
}

class LiveScene : public testing::TestWithParam<size_t> {
protected:
    void SetUp() override {
        buildModel(method(), closedMesh(60), scratch_, "closed");
        buildModel(method(), borderedMesh(110), scratch_, "bordered");
    }
    const Method& method() const { return methods()[GetParam()]; }
    static SceneSettings ample() { return {.open_live = openLive}; }

    const ScratchDirectory scratch_;
};

std::vector<size_t> methodsToLookAt() {
    std::vector<size_t> indices;
    for (size_t i = 0; i < methods().size(); ++i)
        if (methods()[i].open_live != nullptr) indices.push_back(i);
    return indices;
}

INSTANTIATE_TEST_SUITE_P(Methods, LiveScene, testing::ValuesIn(methodsToLookAt()),
                         [](const auto& info) { return methods()[info.param].name; });

TEST_P(LiveScene, showsTheCutOfTheView) {
    for (const char* name : {"closed", "bordered"}) {
        const ModelReader model(scratch_.file(name));
        const Lattice& lattice = model.info().lattice;
        const auto adaptive = openAdaptive(model);
        Budget budget(size_t(512) << 20);
        Scene scene({&model}, ample());
        for (int i = 0; i < 100; i += 17) {
            const FrameRequest request = flight(i, 0.5);
            const Frame& frame = scene.converge(request);
            EXPECT_TRUE(frame.converged);
            EXPECT_EQ(frame.tolerance_px, 0.5);
            EXPECT_TRUE(scene.faults().empty());
            CutRequest cut;
            cut.view = frame.models[0].view;
            cut.pixels = request.pixels;
            const Mesh expected = adaptive->cut(cut, budget).mesh;
            EXPECT_EQ(frame.triangles, expected.triangleCount());
            DrawPatch whole;
            whole.mesh = &expected;
            const ModelPatches reference[] = {{*cut.view, &lattice, {&whole, 1}}};
            const ModelPatches shown[] = {{*cut.view, &lattice, frame.models[0].patches}};
            const Picture picture_of_cut = draw(reference);
            expectSame(picture_of_cut, draw(shown));
            Progress progress;
            const ModelReader* models[] = {&model};
            OfflineSettings offline;
            offline.pixels = request.pixels;
            offline.open_live = openLive;
            const OfflinePicture picture =
                drawModels(models, request.camera, kSize, offline, progress);
            expectSame(picture_of_cut, picture.picture);
            EXPECT_EQ(picture.statistics.tolerance_px, 0.5);
        }
    }
}

/// From a budget that holds little more than the coarsest mesh to more than all.
TEST_P(LiveScene, everyFrameIsOneMeshInAnyBudget) {
    for (const char* name : {"closed", "bordered"}) {
        const ModelReader model(scratch_.file(name));
        const auto live = openLive(model);
        const size_t least = tableBytes(model) + live->bytes();
        Scene first({&model}, ample());
        const MeshTopology expected =
            topologyOf(welded(first.converge(flight(0)).models[0].patches));
        std::set<double> settled;
        for (const size_t more :
             {size_t(60'000), size_t(400'000), size_t(2) << 20, size_t(64) << 20}) {
            SceneSettings settings = ample();
            settings.ram_bytes = least + more;
            settings.adapt_ms = 0.5;
            Scene scene({&model}, settings);
            uint64_t triangles = 0;
            for (int i = 0; i < 80; ++i) {
                FrameRequest request = flight(i);
                request.prefetch = i % 40 < 20;
                const Frame& frame = scene.update(request);
                ASSERT_LE(frame.resident_bytes, settings.ram_bytes) << i;
                ASSERT_EQ(topologyOf(welded(frame.models[0].patches)), expected) << i;
                triangles += frame.triangles;
                if (i % 3 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
            }
            EXPECT_GT(triangles, 0u);
            const Frame& frame = scene.converge(flight(40));
            settled.insert(frame.tolerance_px);
            EXPECT_EQ(frame.converged, frame.tolerance_px == 0.25);
        }
        EXPECT_EQ(*settled.begin(), 0.25);
        EXPECT_GT(settled.size(), 2u);
    }
}

/// Negative control: a chunk of another frame is a crack.
TEST_P(LiveScene, chunksOfDifferentFramesAreNoMesh) {
    const ModelReader model(scratch_.file("closed"));
    Scene scene({&model}, ample());
    const Frame& frame = scene.converge(flight(0));
    const MeshTopology expected = topologyOf(welded(frame.models[0].patches));
    ASSERT_GT(frame.patch_count, 2u);
    const Mesh before = *frame.models[0].patches[1].mesh;
    const uint32_t id = frame.models[0].patches[1].id;
    std::vector<DrawPatch> after = scene.converge(flight(30)).models[0].patches;
    EXPECT_EQ(topologyOf(welded(after)), expected);
    for (DrawPatch& patch : after)
        if (patch.id == id) patch.mesh = &before;
    EXPECT_NE(topologyOf(welded(after)), expected);
}

TEST_P(LiveScene, sharesBudgetsAndToleranceWithPatches) {
    buildModel(methods()[0], borderedMesh(110), scratch_, "patches");
    const ModelReader live(scratch_.file("closed")), patches(scratch_.file("patches"));
    Progress progress;
    const ModelReader* models[] = {&live, &patches};
    for (const size_t ram : {size_t(3) << 20, size_t(64) << 20}) {
        SceneSettings settings = ample();
        settings.ram_bytes = ram;
        Scene scene({&live, &patches}, settings);
        for (int i = 0; i < 60; ++i) ASSERT_LE(scene.update(flight(i)).resident_bytes, ram);
        const FrameRequest request = flight(60);
        const Frame& frame = scene.converge(request);
        EXPECT_EQ(frame.converged, ram > size_t(10) << 20) << frame.tolerance_px;
        EXPECT_GT(frame.models[0].patches.size(), 0u);
        EXPECT_GT(frame.models[1].patches.size(), 0u);
        if (!frame.converged) continue;
        OfflineSettings offline;
        offline.pixels = request.pixels;
        offline.open_live = openLive;
        const Picture expected =
            drawModels(models, request.camera, kSize, offline, progress).picture;
        const ModelPatches shown[] = {
            {frame.models[0].view, &live.info().lattice, frame.models[0].patches},
            {frame.models[1].view, &patches.info().lattice, frame.models[1].patches}};
        expectSame(draw(shown), expected);
    }
}

TEST_P(LiveScene, chunksStaySmallWhenAllIsRefinedAtOnce) {
    const ModelReader model(scratch_.file("bordered"));
    const auto live = openLive(model);
    const View view(flight(0).camera, kSize, model.info().lattice);
    for (int i = 0; i < 12; ++i) {
        settle(model, *live, view, i % 2 == 0 ? 1e9 : 0.02, size_t(1) << 30);
        for (const LiveChunk& chunk : live->chunks())
            ASSERT_LE(chunk.mesh.triangleCount(), 2048u) << i;
    }
}

/// First fit; keeps what it was given.
class StrictSink : public PageSink {
public:
    explicit StrictSink(size_t bytes) : bytes_(bytes) {}
    ~StrictSink() override { EXPECT_TRUE(pages_.empty()) << "pages are left behind"; }

    bool upload(PageKey key, std::span<const Mesh> patches) override {
        CHECK(find(key) == nullptr);
        size_t size = 0;
        for (const Mesh& mesh : patches) size += 12 * mesh.vertexCount() + 6 * mesh.triangleCount();
        size_t begin = 0;
        for (const auto& [offset, page] : pages_) {
            if (begin + size <= offset) break;
            begin = offset + page.size;
        }
        if (begin + size > bytes_) return false;
        pages_[begin] = {key, size, {patches.begin(), patches.end()}};
        used_ += size;
        return true;
    }
    void release(PageKey key) override {
        const auto found = std::find_if(pages_.begin(), pages_.end(),
                                        [&](const auto& p) { return p.second.key == key; });
        CHECK(found != pages_.end());
        used_ -= found->second.size;
        pages_.erase(found);
    }
    bool mayUpload(size_t) override { return true; }
    size_t usedBytes() const override { return used_; }
    size_t capacityBytes() const override { return bytes_; }
    const std::vector<Mesh>* find(PageKey key) const {
        for (const auto& [offset, page] : pages_)
            if (page.key == key) return &page.patches;
        return nullptr;
    }

private:
    struct Page {
        PageKey key;
        size_t size;
        std::vector<Mesh> patches;
    };
    const size_t bytes_;
    size_t used_ = 0;
    std::map<size_t, Page> pages_;
};

TEST_P(LiveScene, everyFrameIsOneMeshInTheRenderersOwnMemory) {
    buildModel(methods()[0], borderedMesh(110), scratch_, "patches");
    const ModelReader live(scratch_.file("closed")), patches(scratch_.file("patches"));
    const MeshTopology expected =
        topologyOf(welded(Scene({&live}, ample()).update(flight(0)).models[0].patches));
    std::set<double> settled;
    for (const size_t device : {size_t(60'000), size_t(250'000), size_t(4) << 20}) {
        StrictSink sink(device);
        SceneSettings settings = ample();
        settings.sink = &sink;
        Scene scene({&patches, &live}, settings);
        for (int i = 0; i < 100; ++i) {
            const Frame& frame = scene.update(flight(i));
            ASSERT_LE(frame.device_bytes, device);
            std::vector<DrawPatch> drawn = frame.models[1].patches;
            for (DrawPatch& patch : drawn) {
                const std::vector<Mesh>* there = sink.find(patch.page);
                ASSERT_NE(there, nullptr) << i;
                patch.mesh = &(*there)[patch.patch];
            }
            ASSERT_EQ(topologyOf(welded(drawn)), expected) << device << " frame " << i;
        }
        settled.insert(scene.converge(flight(100)).tolerance_px);
    }
    EXPECT_EQ(*settled.begin(), 0.25);
    EXPECT_GT(settled.size(), 1u);
}

TEST_P(LiveScene, damagedPagesAreToldAndDrawnCoarser) {
    const ModelReader whole(scratch_.file("closed"));
    const std::string path = scratch_.file("damaged");
    std::filesystem::copy_file(whole.path(), path);
    uint32_t damaged = 0;
    {
        std::fstream file(path, std::ios::in | std::ios::out | std::ios::binary);
        for (uint32_t page = 1; page < whole.pageCount(); ++page)
            if (mixBits(page) % 3 == 0) {
                file.seekp(std::streamoff(whole.page(page).offset + whole.page(page).bytes / 2));
                file.put(char(mixBits(page + 1)));
                ++damaged;
            }
    }
    ASSERT_GT(damaged, 0u);
    const ModelReader model(path);
    Scene scene({&model}, ample());
    const MeshTopology expected = topologyOf(welded(scene.update(flight(0)).models[0].patches));
    for (int i = 0; i < 30; ++i) {
        const Frame& frame = scene.converge(flight(i, 0.05));
        EXPECT_EQ(topologyOf(welded(frame.models[0].patches)), expected);
    }
    EXPECT_FALSE(scene.faults().empty());
    EXPECT_LE(scene.faults().size(), damaged);
    EXPECT_NE(scene.faults()[0].find(path), std::string::npos);
}

TEST_P(LiveScene, pagesThatDoNotFitTheirPlaceAreTold) {
    const ModelReader model(scratch_.file("bordered"));
    const auto live = openLive(model);
    const View view(flight(0).camera, kSize, model.info().lattice);
    live->adapt({.view = &view, .pixels = 0.02, .most_bytes = size_t(1) << 30});
    const std::vector<uint32_t> pages = live->requests(64);
    size_t refused = 0;
    std::vector<std::byte> bytes;
    std::string fault;
    for (size_t i = 1; i < pages.size(); ++i) {
        bytes.clear();
        model.readPage(pages[i], bytes);
        const auto other = live->decode(pages[i], bytes, fault);
        refused += !live->arrive(pages[i - 1], other.get());
        EXPECT_EQ(live->faults().size(), refused);
    }
    EXPECT_GT(refused, 0u);
}

TEST_P(LiveScene, aBudgetBelowTheCoarsestSaysWhatIsNeeded) {
    const ModelReader model(scratch_.file("closed"));
    SceneSettings settings = ample();
    settings.ram_bytes = tableBytes(model) + 1000;
    EXPECT_THROW(Scene({&model}, settings), MemoryError);
    EXPECT_THROW(Scene({&model}, {}), InputError);  // who should open it?
    StrictSink sink(20);
    settings = ample();
    settings.sink = &sink;
    EXPECT_THROW(Scene({&model}, settings), MemoryError);
}

}  // namespace
}  // namespace pietra
