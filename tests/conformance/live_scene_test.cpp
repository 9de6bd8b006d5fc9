// Models whose pages are not patches, as they are looked at: for every method that has them.

#include <gtest/gtest.h>
#include <malloc.h>
#include <unistd.h>

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
#include "runtime/live_uploads.h"
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

TEST_P(LiveScene, showsTheSameThoughWhatIsHiddenIsCoarser) {
    const ModelReader model(scratch_.file("closed"));
    const Lattice& lattice = model.info().lattice;
    Scene scene({&model}, ample());
    const auto drawn = [&](const Frame& frame) {
        const ModelPatches shown[] = {{frame.models[0].view, &lattice, frame.models[0].patches}};
        return draw(shown);
    };
    const Vec3d low = lattice.toInput(model.info().bounds.min);
    const Vec3d high = lattice.toInput(model.info().bounds.max);
    for (int i = 0; i < 100; i += 17) {
        FrameRequest request = flight(i, 0.5);
        request.camera.target = 0.5 * (low + high);  // and all of it is in the picture
        request.camera.eye = request.camera.target +
                             1.2 * glm::length(high - low) *
                                 Vec3d(0.8 * std::cos(0.1 * i), 0.8 * std::sin(0.1 * i), 0.6);
        const uint64_t all = scene.converge(request).triangles;
        const Picture picture = drawn(scene.update(request));
        const MeshTopology expected = topologyOf(welded(scene.update(request).models[0].patches));
        const SeenDepth seen = seenDepth(request.camera, kSize, picture.depth);
        request.seen = &seen;
        const Frame& coarser = scene.converge(request);
        EXPECT_TRUE(coarser.converged);
        EXPECT_LT(coarser.triangles, all);
        EXPECT_EQ(topologyOf(welded(coarser.models[0].patches)), expected);
        expectSame(picture, drawn(coarser));
        // A wall before the eye.
        const std::vector<float> near(picture.depth.size(), 0.01f);
        const SeenDepth wall = seenDepth(request.camera, kSize, near);
        request.seen = &wall;
        const uint64_t hidden = scene.converge(request).triangles;
        request.seen = nullptr;
        request.pixels *= 8;
        EXPECT_LT(double(hidden), 0.5 * double(all));
        // But for what lies across the picture's border.
        const double as_far = double(scene.converge(request).triangles);
        EXPECT_GT(double(hidden), 0.85 * as_far);
        EXPECT_LT(double(hidden), 3 * as_far);
    }
}

/// A closed part and one that is not, in one model: only of the former's chunks some are left out,
/// and only those of which every triangle faces away.
TEST_P(LiveScene, onlyBacksOfClosedPartsAreLeftOut) {
    ConformanceMesh both = closedMesh(60);
    const ConformanceMesh sheet = borderedMesh(60);
    const uint64_t first = both.vertices.position.size();
    for (const Vec3d& p : sheet.vertices.position) both.add(50.0 * p + Vec3d(60, 0, 0));
    for (const auto& t : sheet.triangles)
        both.triangles.push_back({first + t[0], first + t[1], first + t[2]});
    buildModel(method(), both, scratch_, "both");
    const ModelReader reader(scratch_.file("both"));
    const std::unique_ptr<LiveModel> model = openLive(reader, openLive);
    size_t of_closed = 0, known = 0, left_out = 0;
    for (int i = 0; i < 100; i += 9) {
        Camera camera = flight(i).camera;
        camera.target = {0, 0, 0};
        camera.eye *= 200.0;
        const View view(camera, kSize, reader.info().lattice);
        (void)settle(reader, *model, view, 0.1, size_t(1) << 30);
        ASSERT_FALSE(eyeMayBeInside(*model, view));
        std::vector<DrawPatch> drawn;
        listChunks(*model, 0, view, {.cone = true}, false, false, drawn);
        std::set<uint32_t> is_drawn;
        for (const DrawPatch& patch : drawn) is_drawn.insert(uint32_t(patch.page.page));
        for (uint32_t c = 0; c < model->chunks().size(); ++c) {
            const LiveChunk& chunk = model->chunks()[c];
            for (const Triangle& t : chunk.mesh.triangle) {
                std::array<Vec3d, 3> corner;
                for (size_t k = 0; k < 3; ++k) corner[k] = Vec3d(chunk.mesh.position[t[k]]);
                const bool is_sheet =
                    reader.info().lattice.toInput(chunk.mesh.position[t[0]]).x > 58;
                ASSERT_FALSE(is_sheet && chunk.closed);
                of_closed += !is_sheet;
                known += chunk.closed;
                if (is_drawn.contains(c)) continue;
                ++left_out;
                const Vec3d normal = glm::cross(corner[1] - corner[0], corner[2] - corner[0]);
                ASSERT_GE(glm::dot(normal, corner[0] - view.eye()), 0);
            }
        }
    }
    EXPECT_GT(known, of_closed * 9 / 10);
    EXPECT_GT(left_out, of_closed / 200);
}

/// With a triangle less nothing is closed, and all the same else.
TEST_P(LiveScene, refinesBacksLessOnlyWhereNobodySeesThem) {
    ConformanceMesh open = closedMesh(60);
    open.triangles.pop_back();
    buildModel(method(), open, scratch_, "open");
    std::map<std::string, std::array<size_t, 2>> triangles;
    for (const char* name : {"closed", "open"}) {
        const ModelReader reader(scratch_.file(name));
        for (const size_t inside : {0u, 1u}) {
            Camera camera;
            camera.target = {0.1, 0.2, 0};
            camera.eye = Vec3d(inside ? 20 : 120) * Vec3d(0.4, -0.5, 0.8);
            const std::unique_ptr<LiveModel> model = openLive(reader, openLive);
            (void)settle(reader, *model, View(camera, kSize, reader.info().lattice), 0.25,
                         size_t(1) << 30);
            for (const LiveChunk& chunk : model->chunks())
                triangles[name][inside] += chunk.mesh.triangleCount();
        }
    }
    EXPECT_LT(triangles["closed"][0], triangles["open"][0] * 9 / 10);
    EXPECT_GT(triangles["closed"][1], triangles["open"][1] * 19 / 20);
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

/// First fit; keeps what it was given. Every so many frames it has time, if that is not all of
/// them.
class StrictSink : public PageSink {
public:
    explicit StrictSink(size_t bytes, int every = 1) : bytes_(bytes), every_(every) {}
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
        copied += size;
        late += !had_time_;
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
    bool mayUpload(size_t) override { return had_time_ = ++asked_ % every_ == 0; }
    size_t usedBytes() const override { return used_; }
    size_t capacityBytes() const override { return bytes_; }
    size_t copied = 0;  ///< so far
    int late = 0;       ///< pages copied when there was no time
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
    const int every_;
    int asked_ = 0;
    bool had_time_ = true;
    size_t used_ = 0;
    std::map<size_t, Page> pages_;
};

/// A model that tells what is asked of it.
class WatchedModel : public LiveModel {
public:
    static inline size_t largest_budget, releases, freed_by_frames;
    static inline std::thread::id frame_thread;

    static std::unique_ptr<LiveModel> open(const ModelReader& reader) {
        auto model = std::make_unique<WatchedModel>();
        model->model_ = openLive(reader);
        largest_budget = releases = freed_by_frames = 0;
        frame_thread = std::this_thread::get_id();
        return model;
    }
    std::unique_ptr<LivePage> decode(uint32_t page, std::span<const std::byte> bytes,
                                     std::string& fault) const override {
        auto decoded = std::make_unique<Page>();
        decoded->page = model_->decode(page, bytes, fault);
        return decoded;
    }
    bool arrive(uint32_t page, const LivePage* decoded) override {
        return model_->arrive(page, static_cast<const Page*>(decoded)->page.get());
    }
    const LiveFrame& adapt(const LiveTask& task) override {
        largest_budget = std::max(largest_budget, task.most_bytes);
        return model_->adapt(task);
    }
    std::span<const LiveChunk> chunks() const override { return model_->chunks(); }
    std::vector<uint32_t> requests(size_t most) const override { return model_->requests(most); }
    std::vector<uint32_t> prefetch(const View& view, double pixels, size_t most) override {
        return model_->prefetch(view, pixels, most);
    }
    size_t bytes() const override { return model_->bytes(); }
    size_t pageBytes() const override { return model_->pageBytes(); }
    size_t release(size_t bytes) override { return ++releases, model_->release(bytes); }
    std::span<const std::string> faults() const override { return model_->faults(); }

private:
    struct Page : LivePage {
        std::unique_ptr<LivePage> page;
        ~Page() override { freed_by_frames += std::this_thread::get_id() == frame_thread; }
    };
    std::unique_ptr<LiveModel> model_;
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

TEST_P(LiveScene, copiesOnlyWhenThereIsTimeAndNotTooMuch) {
    buildModel(method(), borderedMesh(400), scratch_, "large");
    const ModelReader model(scratch_.file("large"));
    StrictSink sink(size_t(64) << 20, 3);
    SceneSettings settings = ample();
    settings.sink = &sink;
    Scene scene({&model}, settings);
    const int late = sink.late;
    size_t frames = 0, largest = 0;
    for (int i = 0; i < 8; ++i)
        for (bool settled = false; !settled; ++frames) {
            const size_t before = sink.copied;
            settled = scene.update(flight(20 * i, 0.02)).settled;
            largest = std::max(largest, sink.copied - before);
        }
    EXPECT_EQ(sink.late, late);
    EXPECT_GT(sink.copied, 4 * LiveUploads::kFrameBytes);
    EXPECT_LE(sink.copied, frames * LiveUploads::kFrameBytes + largest);
    EXPECT_TRUE(scene.converge(flight(0)).converged);
}

TEST_P(LiveScene, aShortSinkTakesNothingFromRam) {
    buildModel(methods()[0], borderedMesh(110), scratch_, "patches");
    const ModelReader live(scratch_.file("closed")), patches(scratch_.file("patches"));
    StrictSink sink(150'000);
    SceneSettings settings{.sink = &sink, .open_live = WatchedModel::open};
    Scene scene({&patches, &live}, settings);
    EXPECT_TRUE(scene.converge(flight(0)).raised);
    EXPECT_EQ(WatchedModel::releases, 0u);
}

/// It has less than it says.
class BoastingSink : public StrictSink {
public:
    using StrictSink::StrictSink;
    size_t capacityBytes() const override { return 4 * StrictSink::capacityBytes(); }
};

TEST_P(LiveScene, noTaskAllowsMoreThanThereIs) {
    const ModelReader model(scratch_.file("closed"));
    BoastingSink sink(60'000);
    SceneSettings settings{.sink = &sink, .open_live = WatchedModel::open};
    settings.ram_bytes = tableBytes(model) + (size_t(2) << 20);
    Scene scene({&model}, settings);
    for (int i = 0; i < 100; ++i) scene.update(flight(7 * i, 0.02));
    EXPECT_GT(WatchedModel::largest_budget, size_t(1) << 20);
    EXPECT_LE(WatchedModel::largest_budget, size_t(2) << 20);
}

TEST_P(LiveScene, framesFreeNoPages) {
    const ModelReader model(scratch_.file("closed"));
    {
        Scene scene({&model}, {.open_live = WatchedModel::open});
        EXPECT_TRUE(scene.converge(flight(0, 0.1)).converged);
        EXPECT_GT(scene.update(flight(0, 0.1)).bytes_read, 0u);
        EXPECT_EQ(WatchedModel::freed_by_frames, 0u);
    }
}

/// Of this process.
size_t residentNow() {
    std::ifstream file("/proc/self/statm");
    size_t total = 0, resident = 0;
    file >> total >> resident;
    return resident * size_t(::sysconf(_SC_PAGESIZE));
}

TEST_P(LiveScene, holdsWhatItSaysAndGivesItBack) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers keep memory";
#endif
    buildModel(method(), borderedMesh(400), scratch_, "large");
    const ModelReader model(scratch_.file("large"));
    ::malloc_trim(0);
    const size_t before = residentNow();
    const auto live = openLive(model);
    const View near(flight(0).camera, kSize, model.info().lattice);
    Camera far_away = flight(0).camera;
    far_away.eye *= 1e5;
    const View far(far_away, kSize, model.info().lattice);
    const size_t least = live->bytes();
    for (int round = 0; round < 2; ++round) {
        settle(model, *live, near, 0.01, size_t(1) << 30);
        ::malloc_trim(0);
        const size_t held = residentNow() - before;
        EXPECT_GT(held, 20 * least);
        EXPECT_LE(held, live->bytes() + live->bytes() / 20);
        settle(model, *live, far, 1, size_t(1) << 30);
        const size_t said = live->bytes();
        const size_t released = live->release(size_t(1) << 30);
        EXPECT_EQ(released, said - live->bytes());
        EXPECT_LT(live->bytes(), 2 * least + held / 20);
        ::malloc_trim(0);
        // Construction's heaps may have shrunk since; scratch lists stay.
        EXPECT_LE(residentNow(), before + live->bytes() + held / 6);
    }
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
