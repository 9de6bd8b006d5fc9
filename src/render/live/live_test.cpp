#include <random>
#include <thread>

#include "base/scratch_directory.h"
#include "gpu/test_context.h"
#include "render/gl/test_pictures.h"
#include "render/live/gl_live.h"
#include "runtime/scene.h"
#include "store/terrain_model.h"

namespace pietra {
namespace {

class LiveTest : public GlTest {
protected:
    void SetUp() override {
        GlTest::SetUp();
        ToyTerrainSettings settings;
        settings.depth = 11;
        for (const double x : {0.0, 45.0}) {
            settings.seed++;
            const std::string path = scratch_.file(std::to_string(settings.seed));
            writeTerrainModel(makeToyTerrain(settings), path, scratch_.path(), {x, 0, 0});
            models_.push_back(std::make_unique<ModelReader>(path));
        }
    }

    std::vector<const ModelReader*> readers() const { return {models_[0].get(), models_[1].get()}; }

    /// Around both models, with a jump now and then.
    static FrameRequest request(int i) {
        const double angle = 0.03 * i + i / 10;
        FrameRequest request;
        request.camera.target = {40, 20, 0};
        request.camera.eye =
            request.camera.target +
            Vec3d(45 * std::cos(angle), 30 * std::sin(angle), 8 + 3 * std::sin(0.2 * i));
        request.camera.up = {0, 0, 1};
        request.size = {160, 128};
        request.pixels = 0.5;
        request.seconds = i / 60.0;
        return request;
    }

    std::vector<ModelPatches> listOf(const Frame& frame) const {
        std::vector<ModelPatches> list;
        for (size_t m = 0; m < models_.size(); ++m)
            list.push_back(
                {frame.models[m].view, &models_[m]->info().lattice, frame.models[m].patches});
        return list;
    }

    const ScratchDirectory scratch_;
    std::vector<std::unique_ptr<ModelReader>> models_;
};

/// Whatever has arrived: RAM is ample here, so that the lists have meshes, too.
TEST_F(LiveTest, BothDrawEachCutOfAFlightAlikeWhilePagesComeAndGo) {
    const auto cpu = makeRasterLive();
    for (const size_t vram : {kLeastVramBytes, size_t(1) << 24}) {
        GlLive gl(GlContext::adoptCurrent(), {160, 128}, vram);
        Scene scene(readers(), {size_t(1) << 28, 2, gl.sink()});
        size_t largest = 0;
        for (int i = 0; i < 60; ++i) {
            const Frame& frame = scene.update(request(i));
            largest = std::max(largest, frame.device_bytes);
            ASSERT_LE(frame.device_bytes, vram);
            if (i % 2 == 0) std::this_thread::sleep_for(std::chrono::milliseconds(2));
            const std::vector<ModelPatches> list = listOf(frame);
            const LiveSettings settings{{.show = i % 3 == 0 ? Show::kPatches : Show::kShaded},
                                        i % 2 == 0 ? 1 : 4,
                                        i % 5 != 0};
            cpu->draw(list, settings);
            gl.draw(list, settings);
            expectAlike(cpu->picture(), gl.picture(), "frame " + std::to_string(i), 5e-3f);
            if (HasFailure()) return;
        }
        EXPECT_GT(largest, kLeastVramBytes / 2);
        FrameRequest finer = request(0);
        finer.pixels = 0.1;
        EXPECT_EQ(scene.converge(finer).converged, vram > kLeastVramBytes);
    }
}

TEST_F(LiveTest, TellsDepthsAndTimesAndFollowsTheSize) {
    GlLive gl(GlContext::adoptCurrent(), {160, 128}, size_t(1) << 24);
    Scene scene(readers(), {size_t(1) << 28, 2, gl.sink()});
    for (const PictureSize size : {PictureSize{160, 128}, PictureSize{333, 77}}) {
        FrameRequest asked = request(7);
        asked.size = size;
        const Frame& frame = scene.converge(asked);
        EXPECT_TRUE(frame.converged);
        gl.draw(listOf(frame), {});
        gl.wait();
        EXPECT_GT(gl.gpuMs(), 0);
        const Picture picture = gl.picture();
        ASSERT_EQ(picture.pixelCount(), size_t(size.width) * size_t(size.height));
        for (int x = 0; x < size.width; x += 10)
            EXPECT_EQ(gl.depthAt(x, size.height / 2),
                      picture.depth[picture.index(x, size.height / 2)]);
    }
}

TEST_F(LiveTest, AnotherSceneMayUseTheSameMemory) {
    GlLive gl(GlContext::adoptCurrent(), {160, 128}, size_t(1) << 24);
    for (int i = 0; i < 2; ++i) {
        Scene scene(readers(), {size_t(1) << 28, 2, gl.sink()});
        EXPECT_TRUE(scene.converge(request(3)).converged);
    }
    EXPECT_EQ(gl.sink()->usedBytes(), 0u);
}

}  // namespace
}  // namespace pietra
