#include "runtime/scene.h"

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <random>

#include "base/check.h"
#include "base/error.h"
#include "base/scratch_directory.h"
#include "runtime/page_pool.h"
#include "store/terrain_model.h"

namespace pietra {
namespace {

class SceneTest : public ::testing::Test {
protected:
    SceneTest() {
        ToyTerrainSettings settings;
        settings.depth = 12;
        ToyTerrain terrain = makeToyTerrain(settings);
        path_ = scratch_.file("terrain");
        writeTerrainModel(terrain, path_, scratch_.path(), {0, 0, 0});
        for (Node& node : terrain.nodes) node.closed = true;
        closed_path_ = scratch_.file("closed");
        writeTerrainModel(terrain, closed_path_, scratch_.path(), {0, 0, 0});
    }

    const ScratchDirectory scratch_;
    std::string path_;
    std::string closed_path_;  // the same, as if it were part of something closed
};

/// Takes a page where it first fits in one piece, now and then has no time, and trusts nobody.
/// One that is busy refuses every eighth page, too, as if what is free lay in too many places.
class FakeSink : public PageSink {
public:
    explicit FakeSink(size_t bytes, double busy = 0) : bytes_(bytes), busy_(busy) {}
    ~FakeSink() override { EXPECT_TRUE(pages_.empty()) << "pages are left behind"; }

    bool upload(PageKey key, std::span<const Mesh> patches) override {
        CHECK(!holds(key));
        size_t size = 0;
        for (const Mesh& mesh : patches) size += 16 * mesh.vertexCount() + 6 * mesh.triangleCount();
        size_t begin = 0;
        for (const auto& [offset, page] : pages_) {
            if (begin + size <= offset) break;
            begin = offset + page.size;
        }
        if (begin + size > bytes_ || (busy_ > 0 && ++offered_ % 8 == 0)) {
            ++refused;
            return false;
        }
        pages_[begin] = {key, size};
        used_ += size;
        return true;
    }
    void release(PageKey key) override {
        const auto found = find(key);
        CHECK(found != pages_.end());
        ++released;
        used_ -= found->second.size;
        pages_.erase(found);
    }
    bool mayUpload(size_t) override {
        return std::uniform_real_distribution<>(0, 1)(random_) >= busy_;
    }
    size_t usedBytes() const override { return used_; }
    size_t capacityBytes() const override { return bytes_; }
    bool holds(PageKey key) { return find(key) != pages_.end(); }

    int refused = 0, released = 0;

private:
    struct Page {
        PageKey key;
        size_t size;
    };
    std::map<size_t, Page>::iterator find(PageKey key) {
        return std::find_if(pages_.begin(), pages_.end(),
                            [&](const auto& page) { return page.second.key == key; });
    }

    const size_t bytes_;
    const double busy_;
    int offered_ = 0;
    size_t used_ = 0;
    std::map<size_t, Page> pages_;  // by offset
    std::mt19937 random_{1};
};

/// Frame i of a flight around the model and close over it.
FrameRequest flight(const ModelReader& model, int i) {
    const Vec3d low = model.info().lattice.toInput(model.info().bounds.min);
    const Vec3d high = model.info().lattice.toInput(model.info().bounds.max);
    const double size = high.x - low.x, angle = 0.05 * i;
    FrameRequest request;
    request.camera.target = 0.5 * (low + high);
    request.camera.eye =
        request.camera.target + size * Vec3d(0.6 * std::cos(angle), 0.6 * std::sin(angle),
                                             0.05 + 0.5 * (1 + std::sin(0.13 * i)));
    request.camera.up = {0, 0, 1};
    request.size = {640, 480};
    request.pixels = 2;
    request.seconds = i / 60.0;
    return request;
}

size_t sizeOfAll(const ModelReader& model) {
    Scene scene({&model}, {});
    FrameRequest request = flight(model, 0);
    request.pixels = 0;
    request.culling = {};
    return scene.converge(request).resident_bytes - tableBytes(model);
}

TEST_F(SceneTest, settlesAtTheOfflineCut) {
    const ModelReader model(path_);
    Scene scene({&model}, {});
    for (int i = 0; i < 200; i += 20) {
        const FrameRequest request = flight(model, i);
        const Frame& frame = scene.converge(request);
        EXPECT_TRUE(frame.converged);
        EXPECT_TRUE(scene.faults().empty()) << scene.faults().front();
        EXPECT_LE(frame.tolerance_px, request.pixels);
        const ModelFrame& drawn = frame.models[0];
        EXPECT_EQ(drawn.selection.draw,
                  visibleCut(model.nodes(), drawn.view, request.pixels, request.culling).nodes);
        ASSERT_EQ(drawn.patches.size(), frame.patch_count);
        EXPECT_GT(frame.patch_count, 0u);
        for (const DrawPatch& patch : drawn.patches) EXPECT_GT(patch.mesh->triangleCount(), 0u);
    }
}

TEST_F(SceneTest, everyFrameIsValidInAnyBudget) {
    const ModelReader model(path_);
    const size_t all = sizeOfAll(model);
    for (const size_t budget : {all / 40, all / 10, all / 3, 2 * all}) {
        const size_t tables = tableBytes(model);
        Scene scene({&model}, {tables + budget, 3});
        double finest = 1e300;
        for (int i = 0; i < 300; ++i) {
            FrameRequest request = flight(model, i);
            request.culling = {};
            request.prefetch = i % 100 < 50;
            const Frame& frame = scene.update(request);
            ASSERT_EQ(validateCut(model.nodes(), frame.models[0].selection.draw), "");
            ASSERT_LE(frame.resident_bytes, tables + budget);
            finest = std::min(finest, frame.tolerance_px);
            if (i % 3 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        EXPECT_LT(finest, 1e300);
    }
}

TEST_F(SceneTest, everyFrameIsValidInAnyTwoBudgets) {
    const ModelReader open(path_), closed(closed_path_);
    const size_t all = sizeOfAll(open);
    int refused = 0;
    for (const auto& [ram, device] :
         {std::pair(all / 40, all / 40), std::pair(all / 40, all), std::pair(all / 4, all / 10),
          std::pair(4 * all, all / 3), std::pair(4 * all, 2 * all)}) {
        FakeSink sink(device, 0.3);
        const size_t tables = tableBytes(open) + tableBytes(closed);
        Scene scene({&open, &closed}, {tables + ram, 3, &sink});
        double finest = 1e300;
        for (int i = 0; i < 150; ++i) {
            FrameRequest request = flight(open, i < 100 ? i : 31 * i);
            request.culling = {};
            request.prefetch = i % 100 < 50;
            const Frame& frame = scene.update(request);
            for (const ModelFrame& model : frame.models) {
                ASSERT_EQ(validateCut(open.nodes(), model.selection.draw), "");
                for (const DrawPatch& patch : model.patches) ASSERT_TRUE(sink.holds(patch.page));
            }
            ASSERT_LE(frame.resident_bytes, tables + ram);
            ASSERT_EQ(frame.device_bytes, sink.usedBytes());
            finest = std::min(finest, frame.tolerance_px);
            if (i % 3 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(1));
        }
        EXPECT_LT(finest, 1e300);
        refused += sink.refused;
    }
    EXPECT_GT(refused, 0);
}

TEST_F(SceneTest, whatIsDrawnElsewhereNeedNotFitIntoRam) {
    const ModelReader model(closed_path_);
    const size_t all = sizeOfAll(model), little = all / 16;
    FakeSink sink(all);
    Scene scene({&model}, {tableBytes(model) + little, 2, &sink}), in_ram({&model}, {});
    int outside = 0;
    for (int i = 0; i < 200; i += 40) {
        FrameRequest request = flight(model, i);
        request.pixels = 0.3;
        const Frame& frame = scene.converge(request);
        EXPECT_TRUE(frame.converged);
        EXPECT_LE(frame.resident_bytes, tableBytes(model) + little);
        EXPECT_GT(frame.device_bytes, 2 * little);
        const ModelFrame& expected = in_ram.converge(request).models[0];
        EXPECT_EQ(frame.models[0].two_sided, expected.two_sided);
        EXPECT_EQ(frame.models[0].selection.draw, expected.selection.draw);
        outside += !expected.two_sided;
    }
    EXPECT_GT(outside, 0);
}

TEST_F(SceneTest, scarceMemoryOfBothKindsSettles) {
    const ModelReader model(closed_path_);
    const size_t all = sizeOfAll(model);
    for (const size_t ram : {all / 12, all / 6, all / 3})
        for (const size_t device : {all / 6, all / 3, all}) {
            FakeSink sink(device);
            Scene scene({&model}, {tableBytes(model) + ram, 2, &sink});
            for (int i = 0; i < 200; i += 40) {
                FrameRequest request = flight(model, i);
                request.pixels = 0.3;
                request.prefetch = false;
                const Frame& frame = scene.converge(request);  // returns
                EXPECT_TRUE(frame.settled);
                // What is settled stays.
                const std::vector<NodeIndex> drawn = frame.models[0].selection.draw;
                for (int again = 0; again < 10; ++again)
                    ASSERT_EQ(scene.update(request).models[0].selection.draw, drawn);
            }
        }
}

TEST_F(SceneTest, whatComesBackToTheSinkIsNotReadAgain) {
    const ModelReader model(path_);
    const size_t all = sizeOfAll(model);
    FakeSink sink(all / 5);
    Scene scene({&model}, {tableBytes(model) + 2 * all, 2, &sink});
    FrameRequest request = flight(model, 0);
    request.pixels = 0.1;
    request.prefetch = false;
    const Vec3d centre = request.camera.target;
    uint64_t read = 0;
    for (int i = 0; i < 12; ++i) {  // down at one corner after the other
        const Vec3d side(i % 2 == 0 ? 30 : -30, i % 4 < 2 ? 30 : -30, 0);
        request.camera.target = centre + side;
        request.camera.eye = centre + 1.2 * side + Vec3d(0, 0, 15);
        const Frame& frame = scene.converge(request);
        EXPECT_TRUE(frame.converged);
        if (i == 7) read = frame.bytes_read;
        if (i > 7) {
            EXPECT_EQ(frame.bytes_read, read);
        }
    }
    EXPECT_GT(sink.released, 100) << sink.usedBytes() << " of " << all;
}

TEST_F(SceneTest, tooLittleRoomToDrawRaisesTheToleranceAndStaysWithinIt) {
    const ModelReader model(path_);
    const size_t all = sizeOfAll(model);
    FakeSink sink(all / 10);
    Scene scene({&model}, {tableBytes(model) + all, 2, &sink});
    FrameRequest request = flight(model, 0);
    request.pixels = 0.01;
    request.culling = {};
    EXPECT_GT(scene.converge(request).tolerance_px, request.pixels);
    request.pixels = 64;
    EXPECT_TRUE(scene.converge(request).converged);
}

TEST_F(SceneTest, tooSmallABudgetRaisesTheToleranceAndStaysWithinIt) {
    const ModelReader model(path_);
    const size_t all = sizeOfAll(model);
    Scene scene({&model}, {tableBytes(model) + all / 8, 2});
    FrameRequest request = flight(model, 0);
    request.pixels = 0.01;
    request.culling = {};
    const Frame& frame = scene.converge(request);
    EXPECT_FALSE(frame.converged);
    EXPECT_GT(frame.tolerance_px, request.pixels);
    EXPECT_LE(frame.resident_bytes, tableBytes(model) + all / 8);
    // With room again it comes down to what is asked for.
    request.pixels = 64;
    EXPECT_TRUE(scene.converge(request).converged);
}

TEST_F(SceneTest, pagesForLaterLeaveWhatOthersNeedNow) {
    const ModelReader reader(path_);
    SceneModels models;
    models.push_back(std::make_unique<SceneModel>(reader));
    const size_t ram = sizeOfAll(reader);
    PagePool pool(models, ram, 0, 1, nullptr);
    const size_t least = pool.ramBytes();
    for (uint32_t frame = 100; frame < 102; ++frame) {
        pool.publish(frame);
        for (PageIndex page = 0; page < reader.pageCount(); ++page)
            if (!models[0]->hasCopy(page)) pool.want({0, page}, Need::kLater);
        pool.setElsewhere(0, frame == 100 ? ram - least : (ram - least) / 2);
        pool.load();
        EXPECT_EQ(pool.ramBytes() > least, frame > 100);
        EXPECT_EQ(pool.missing(), 0u);
    }
    EXPECT_LE(pool.ramBytes() - least, (ram - least) / 2);
}

TEST_F(SceneTest, saysHowMuchTheRootsNeed) {
    const ModelReader model(path_);
    EXPECT_THROW(Scene({&model}, {100, 1}), MemoryError);
    FakeSink sink(100);
    try {
        Scene({&model}, {size_t(1) << 30, 1, &sink});
        FAIL() << "it needs more";
    } catch (const MemoryError& error) {
        EXPECT_NE(std::string(error.what()).find("of graphics memory"), std::string::npos);
    }
}

TEST_F(SceneTest, aDamagedPageIsDrawnCoarser) {
    const ModelReader whole(path_);
    const PageInfo page = whole.page(whole.pageCount() / 3);
    {
        std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
        file.seekp(std::streamoff(page.offset + page.bytes / 2));
        file.write("broken", 6);
    }
    const ModelReader model(path_);
    Scene scene({&model}, {});
    FrameRequest request = flight(model, 0);
    request.pixels = 0;
    request.culling = {};
    const Frame& frame = scene.converge(request);
    EXPECT_EQ(scene.faults().size(), 1u);
    EXPECT_EQ(validateCut(model.nodes(), frame.models[0].selection.draw), "");
    EXPECT_LT(frame.triangles, finestCut(model.nodes()).triangles);
}

}  // namespace
}  // namespace pietra
