#include "render/raster/farthest_depths.h"

#include <gtest/gtest.h>

#include <random>
#include <string>

#include "base/parallel.h"
#include "render/raster/rasteriser.h"
#include "render/raster/test_meshes.h"

namespace pietra {
namespace {

using namespace test_meshes;

PixelBox randomBox(std::mt19937& random, const PixelBox& within) {
    const int32_t x = within.x0 + int32_t(random() % unsigned(within.x1 - within.x0));
    const int32_t y = within.y0 + int32_t(random() % unsigned(within.y1 - within.y0));
    return {x, y, x + 1 + int32_t(random() % unsigned(within.x1 - x)),
            y + 1 + int32_t(random() % unsigned(within.y1 - y))};
}

VisibilityKey keyOf(float inv_depth) {
    return VisibilityKey(std::bit_cast<uint32_t>(inv_depth)) << 32 | lowerWord(7);
}

/// The least 1 / depth in a box.
float leastWithin(const VisibilityTile& tile, const PixelBox& box) {
    float least = 1e30f;
    for (int32_t y = box.y0; y < box.y1; ++y)
        for (int32_t x = box.x0; x < box.x1; ++x)
            for (int s = 0; s < tile.samples; ++s) {
                const VisibilityKey key = tile.key[(y * tile.width + x) * tile.samples + s];
                least = std::min(least, std::bit_cast<float>(uint32_t(key >> 32)));
            }
    return least;
}

TEST(FarthestDepths, HidesOnlyWhatIsBehindEverySampleWhateverIsDrawnInBetween) {
    std::mt19937 random(1);
    for (const int samples : {1, 4}) {
        int hidden = 0;
        for (int round = 0; round < 40; ++round) {
            constexpr int32_t kWidth = 61, kHeight = 47;
            std::vector<VisibilityKey> key(size_t(kWidth * kHeight * samples), keyOf(1));
            const VisibilityTile tile{key.data(), kWidth, samples,
                                      randomBox(random, {0, 0, kWidth, kHeight})};
            FarthestDepths farthest(tile);
            for (int step = 0; step < 200; ++step) {
                const PixelBox box = randomBox(random, tile.box);
                if (step % 2) {
                    const float depth = 1 + 0.01f * float(random() % 100);
                    for (int32_t y = box.y0; y < box.y1; ++y)
                        for (int32_t i = box.x0 * samples; i < box.x1 * samples; ++i) {
                            VisibilityKey& k = key[size_t(y * kWidth * samples + i)];
                            k = std::max(k, keyOf(depth));
                        }
                    farthest.changed(box);
                }
                const float least = leastWithin(tile, box);
                EXPECT_FALSE(farthest.hide(box, least));
                hidden += farthest.hide(box, std::nextafter(least, 0.0f));
                EXPECT_TRUE(
                    farthest.hide(tile.box, std::nextafter(leastWithin(tile, tile.box), 0.0f)));
            }
        }
        EXPECT_GT(hidden, 1000);
    }
}

/// One or several models, each on a lattice of its own.
struct Crowd {
    std::vector<Mesh> meshes;
    std::vector<std::vector<DrawPatch>> patches;  // of a model
    std::vector<Lattice> lattices;
    PictureSize size{200, 150};

    void addModel(const Lattice& lattice) {
        lattices.push_back(lattice);
        patches.emplace_back();
    }
    /// In pieces, so that some are seen and others are not.
    void add(const Mesh& mesh, bool one_sided, size_t piece = 60) {
        for (size_t begin = 0; begin < mesh.triangleCount(); begin += piece) {
            meshes.push_back(part(mesh, begin, std::min(begin + piece, mesh.triangleCount())));
            const auto id = uint32_t(meshes.size());
            patches.back().push_back({nullptr, one_sided, id, {}, 0});
        }
    }
    std::vector<ModelPatches> at(const Camera& camera) {
        size_t mesh = 0;
        std::vector<ModelPatches> models;
        for (size_t m = 0; m < patches.size(); ++m) {
            for (DrawPatch& patch : patches[m]) patch.mesh = &meshes[mesh++];
            models.push_back({View(camera, size, lattices[m]), &lattices[m], patches[m]});
        }
        return models;
    }
};

/// Ridges, balls in balls, walls, and the ridges once more: there everything coincides.
Crowd makeCrowd() {
    Crowd crowd;
    crowd.addModel({});
    crowd.add(terrain(60, 50, 4000, 1500), false);
    for (const double radius : {500.0, 300.0, 100.0})
        crowd.add(sphere({2500, 2500, 900}, radius, 40, 30), true);
    Lattice fine;
    fine.origin = Vec3d(-64, 128, -256);
    fine.step = 0.5;
    crowd.addModel(fine);
    for (int i = 0; i < 6; ++i)
        crowd.add(grid(20, 10,
                       [&](double u, double v) {
                           return Vec3d(2000 + 5000 * u, 3000 + 900 * i, 1000 + 2500 * v);
                       }),
                  false, 50);
    crowd.addModel({});
    crowd.add(terrain(60, 50, 4000, 1500), false, 90);
    return crowd;
}

Camera randomCamera(std::mt19937& random) {
    std::uniform_real_distribution<double> at(0, 4000), height(200, 3000), angle(25, 100);
    return {{at(random), at(random), height(random)},
            {at(random), at(random), height(random) / 2},
            {0, 0, 1},
            angle(random)};
}

void draw(Rasteriser& rasteriser, const std::vector<ModelPatches>& models, bool unhidden,
          const ShadeSettings& settings) {
    rasteriser.restart(models[0].view, *models[0].lattice, settings);
    if (unhidden) rasteriser.draw(models, true);
    for (const ModelPatches& m : models) {
        if (unhidden) continue;
        rasteriser.setModel(m.view, *m.lattice);
        rasteriser.draw(m.patches);
    }
}

TEST(Unhidden, LeavingOutWhatIsHiddenChangesNoPixel) {
    Crowd crowd = makeCrowd();
    std::mt19937 random(4);
    for (const int samples : {1, 4}) {
        const View any({}, crowd.size, {});
        Rasteriser all(any, {}, samples, {}), unhidden(any, {}, samples, {});
        uint64_t triangles = 0, hidden = 0;
        for (int round = 0; round < 60; ++round) {
            const ThreadLimit limit(round % 3 == 0 ? 1 : 2 + round % 5);
            ShadeSettings settings;
            settings.show = Show(round % 2 ? int(Show::kShaded) : int(Show::kPatches));
            settings.two_sided = round % 5 == 0;
            const std::vector<ModelPatches> models = crowd.at(randomCamera(random));
            draw(all, models, false, settings);
            draw(unhidden, models, true, settings);
            const Picture &expected = all.finish(), &picture = unhidden.finish();
            ASSERT_EQ(picture.depth, expected.depth) << round;
            ASSERT_EQ(picture.colour, expected.colour) << round;
            triangles += unhidden.statistics().triangles;
            hidden += unhidden.statistics().triangles_hidden;
        }
        EXPECT_GT(hidden, triangles / 2);
        EXPECT_EQ(all.statistics().triangles_hidden, 0u);
    }
}

TEST(Unhidden, WhatAWallHidesIsNotDrawnAndWhatIsAtTheEyeIs) {
    const Mesh wall = grid(4, 4, [](double u, double v) {  // y = 0
        return Vec3d(2000 * u - 1000, 0, 2000 * v - 1000);
    });
    Crowd crowd;
    crowd.addModel({});
    for (int i = 0; i < 20; ++i) crowd.add(sphere({40.0 * i - 400, 300, 0}, 30, 8, 6), false, 1000);
    const uint64_t balls = 20 * crowd.meshes[0].triangleCount();
    crowd.add(wall, false);  // drawn last, and yet it hides
    Rasteriser rasteriser(View({}, crowd.size, {}), {}, 1, {});
    const auto hidden = [&](const Vec3d& eye, const Vec3d& target) {
        draw(rasteriser, crowd.at({eye, target, {0, 0, 1}, 60}), true, {});
        rasteriser.finish();
        return rasteriser.statistics().triangles_hidden;
    };
    EXPECT_EQ(hidden({0, -1500, 0}, {0, 0, 0}), balls);
    EXPECT_EQ(hidden({0, -1500, 0}, {0, 0, 0}), balls);
    EXPECT_EQ(hidden({100, 1500, 0}, {0, 0, 0}), 0u);
    // Within the first ball, which reaches behind the eye as the wall does; the second reaches into
    // it.
    EXPECT_EQ(hidden({-405, 300, 0}, {0, 300, 0}), balls * 18 / 20);
}

}  // namespace
}  // namespace pietra
