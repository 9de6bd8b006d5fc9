#include "render/offline/offline_picture.h"

#include <gtest/gtest.h>

#include <cmath>

#include "base/error.h"
#include "base/parallel.h"
#include "base/scratch_directory.h"
#include "store/terrain_model.h"

namespace pietra {
namespace {

class OfflineTest : public ::testing::Test {
protected:
    std::string writeTerrain(const std::string& name, const Vec3d& origin) const {
        const std::string path = scratch_.file(name);
        writeTerrainModel(makeToyTerrain(), path, scratch_.path(), origin);
        return path;
    }

private:
    const ScratchDirectory scratch_;
};

struct Terrain {
    ModelReader reader;
    Camera camera;
    explicit Terrain(const std::string& path) : reader(path) {
        const ModelInfo& info = reader.info();
        const Vec3d low = info.lattice.toInput(info.bounds.min),
                    high = info.lattice.toInput(info.bounds.max);
        camera.target = 0.5 * (low + high);
        camera.eye = camera.target + Vec3d(0.2, -0.7, 0.8) * (high.x - low.x);
        camera.up = {0, 0, 1};
    }
    OfflinePicture draw(const OfflineSettings& settings) const {
        return draw(settings, std::vector{&reader});
    }
    OfflinePicture draw(const OfflineSettings& settings,
                        const std::vector<const ModelReader*>& models) const {
        Progress progress;
        return drawModels(models, camera, {200, 160}, settings, progress);
    }
};

OfflineSettings smallest(OfflineSettings settings, const Terrain& terrain) {
    for (settings.memory_bytes = 1 << 10;; settings.memory_bytes += 1 << 10) {
        try {
            terrain.draw(settings);
            return settings;
        } catch (const MemoryError&) {
        }
    }
}

TEST_F(OfflineTest, CoarserTolerancesDrawLessAndZeroDrawsTheFullMesh) {
    const Terrain terrain(writeTerrain("a", {0, 0, 0}));
    uint64_t full = 0;
    for (const NodeIndex i : finestCut(terrain.reader.nodes()).nodes)
        full += terrain.reader.nodes()[i].triangles;
    uint64_t before = ~uint64_t(0);
    for (const double pixels : {0.0, 0.5, 2.0, 8.0, 1e9}) {
        OfflineSettings settings;
        settings.pixels = pixels;
        const OfflineStatistics statistics = terrain.draw(settings).statistics;
        if (pixels == 0) {
            EXPECT_EQ(statistics.triangles, full);
        }
        EXPECT_LE(statistics.triangles, before) << pixels;
        EXPECT_GT(statistics.pixels_covered, 1000u);
        before = statistics.triangles;
    }
    EXPECT_LT(before, full / 10);
}

TEST_F(OfflineTest, NeitherMemoryNorThreadsChangeThePicture) {
    const Terrain terrain(writeTerrain("a", {0, 0, 0}));
    OfflineSettings settings;
    settings.pixels = 0;
    settings.shade.show = Show::kTriangles;
    const Picture picture = terrain.draw(settings).picture;
    settings.culling.occlusion = true;  // in each batch, by what the ones before left
    const OfflineSettings tight = smallest(settings, terrain);
    EXPECT_LT(tight.memory_bytes, settings.memory_bytes / 100);
    for (const int jobs : {1, 2, 7}) {
        const ThreadLimit threads(jobs);
        const OfflinePicture again = terrain.draw(jobs == 1 ? tight : settings);
        EXPECT_EQ(again.picture.colour, picture.colour);
        EXPECT_EQ(again.picture.depth, picture.depth);
    }
    EXPECT_LE(terrain.draw(tight).statistics.resident_bytes, tight.memory_bytes);
}

TEST_F(OfflineTest, CullingChangesNoPixel) {
    Terrain terrain(writeTerrain("a", {0, 0, 0}));
    terrain.camera.eye = 0.5 * (terrain.camera.eye + terrain.camera.target);
    OfflineSettings settings;
    settings.pixels = 0;
    const OfflinePicture all = terrain.draw(settings);
    settings.culling = {.frustum = true, .cone = true, .contribution = true, .occlusion = true};
    const OfflinePicture culled = terrain.draw(settings);
    EXPECT_LT(culled.statistics.triangles, all.statistics.triangles);
    EXPECT_EQ(culled.picture.colour, all.picture.colour);
    EXPECT_EQ(culled.picture.depth, all.picture.depth);
}

TEST_F(OfflineTest, ModelsOnDifferentLatticesShareAScene) {
    const Terrain near(writeTerrain("a", {0, 0, 0})), far(writeTerrain("b", {0, 0, -3}));
    OfflineSettings settings;
    const OfflinePicture one = near.draw(settings);
    const OfflinePicture both = near.draw(settings, {&far.reader, &near.reader});
    settings.culling.occlusion = true;
    const OfflinePicture unhidden = near.draw(settings, {&far.reader, &near.reader});
    EXPECT_EQ(unhidden.picture.colour, both.picture.colour);
    EXPECT_EQ(unhidden.picture.depth, both.picture.depth);
    EXPECT_GT(both.statistics.triangles, one.statistics.triangles);
    EXPECT_GT(both.statistics.pixels_covered, one.statistics.pixels_covered);
    size_t same = 0;
    for (size_t i = 0; i < one.picture.pixelCount(); ++i) {
        EXPECT_LE(both.picture.depth[i], one.picture.depth[i]);
        same +=
            std::isfinite(one.picture.depth[i]) && both.picture.depth[i] == one.picture.depth[i];
    }
    EXPECT_EQ(same, one.statistics.pixels_covered);  // what lies behind hides nothing
}

TEST_F(OfflineTest, SaysHowMuchMemoryItNeeds) {
    const Terrain terrain(writeTerrain("a", {0, 0, 0}));
    OfflineSettings settings;
    settings.memory_bytes = 1000;
    try {
        terrain.draw(settings);
        FAIL();
    } catch (const MemoryError& error) {
        EXPECT_TRUE(std::string(error.what()).starts_with("drawing this needs ")) << error.what();
    }
}

bool glIsThere(const Terrain& terrain, OfflineSettings settings, std::string& why) {
    settings.renderer = DrawWith::kGl;
    try {
        terrain.draw(settings);
        return true;
    } catch (const UsageError& error) {
        why = error.what();
        return false;
    }
}

/// Pixels that differ in coverage, or by more than 2 of 255, or in depth by a thousandth.
size_t differences(const Picture& a, const Picture& b) {
    size_t count = 0;
    for (size_t i = 0; i < a.pixelCount(); ++i) {
        const Rgba8 &c = a.colour[i], &d = b.colour[i];
        const bool there = std::isfinite(a.depth[i]);
        count += there != std::isfinite(b.depth[i]) || std::abs(c.r - d.r) > 2 ||
                 std::abs(c.g - d.g) > 2 || std::abs(c.b - d.b) > 2 ||
                 (there && std::abs(a.depth[i] - b.depth[i]) > 1e-3f * a.depth[i]);
    }
    return count;
}

TEST_F(OfflineTest, OpenGlDrawsTheSameInAnyMemory) {
    const Terrain terrain(writeTerrain("a", {0, 0, 0})), other(writeTerrain("b", {0, 0, -3}));
    OfflineSettings settings;
    std::string why;
    if (!glIsThere(terrain, settings, why)) GTEST_SKIP() << why;
    settings.pixels = 0;
    for (settings.samples = 1; settings.samples <= 4; settings.samples += 3) {
        settings.renderer = DrawWith::kCpu;
        const OfflinePicture cpu = terrain.draw(settings, {&other.reader, &terrain.reader});
        settings.renderer = DrawWith::kGl;
        const OfflinePicture gpu = terrain.draw(settings, {&other.reader, &terrain.reader});
        EXPECT_LE(differences(cpu.picture, gpu.picture), cpu.picture.pixelCount() / 200);
        EXPECT_EQ(gpu.statistics.triangles, cpu.statistics.triangles);
        EXPECT_EQ(gpu.statistics.patches, cpu.statistics.patches);
        EXPECT_NEAR(double(gpu.statistics.pixels_covered), double(cpu.statistics.pixels_covered),
                    1e-4 * double(cpu.picture.pixelCount()));
        const Picture alone = terrain.draw(settings).picture;
        const OfflineSettings tight = smallest(settings, terrain);
        for (const int jobs : {1, 3}) {
            const ThreadLimit threads(jobs);
            const OfflinePicture again = terrain.draw(tight);
            EXPECT_EQ(again.picture.colour, alone.colour);
            EXPECT_EQ(again.picture.depth, alone.depth);
            EXPECT_LE(again.statistics.resident_bytes, tight.memory_bytes);
            EXPECT_GT(again.statistics.device_bytes, 0u);
        }
    }
}

}  // namespace
}  // namespace pietra
