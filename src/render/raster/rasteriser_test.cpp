#include "render/raster/rasteriser.h"

#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <algorithm>
#include <limits>
#include <random>
#include <string>

#include "base/parallel.h"
#include "render/raster/projection.h"
#include "render/raster/test_meshes.h"

namespace pietra {
namespace {

using namespace test_meshes;

constexpr float kNothing = std::numeric_limits<float>::infinity();

Picture render(const View& view, std::span<const DrawPatch> patches, int samples = 1,
               const ShadeSettings& settings = {}) {
    Rasteriser rasteriser(view, Lattice{}, samples, settings);
    rasteriser.draw(patches);
    return rasteriser.finish();
}

Picture render(const View& view, const Mesh& mesh, bool one_sided = false, int samples = 1) {
    const DrawPatch patch{&mesh, one_sided, 0, {}, 0};
    return render(view, {&patch, 1}, samples);
}

std::vector<int> covered(const Picture& picture) {
    std::vector<int> result;
    for (const float depth : picture.depth) result.push_back(depth != kNothing);
    return result;
}

/// The reference: a point moved by (eps, eps^2) is strictly inside, which is what the top-left rule
/// says; every pixel against every triangle, in exact arithmetic.
bool coversExactly(const ScreenVertex& a, const ScreenVertex& b, const ScreenVertex& c, int64_t x,
                   int64_t y) {
    const auto side = [&](const ScreenVertex& p, const ScreenVertex& q) {
        const __int128 dx = int64_t(q.x) - p.x, dy = int64_t(q.y) - p.y;
        const __int128 value = dx * (y - p.y) - dy * (x - p.x);
        if (value != 0) return value > 0 ? 1 : -1;
        if (dy != 0) return dy < 0 ? 1 : -1;
        return dx > 0 ? 1 : dx < 0 ? -1 : 0;
    };
    const int s = side(a, b);
    return s != 0 && side(b, c) == s && side(c, a) == s;
}

std::vector<int> coverageCounts(const View& view, const Mesh& mesh) {
    const Projection projection(view, Lattice{});
    const PictureSize size = view.size();
    std::vector<int> count(size_t(size.width) * size.height, 0);
    for (const Triangle& t : mesh.triangle) {
        ScreenVertex v[3];
        for (int k = 0; k < 3; ++k)
            v[k] = projection.project(projection.viewPosition(mesh.position[t[k]]));
        for (int y = 0; y < size.height; ++y)
            for (int x = 0; x < size.width; ++x)
                count[size_t(y) * size.width + x] +=
                    coversExactly(v[0], v[1], v[2], x * 256 + 128, y * 256 + 128);
    }
    return count;
}

/// How many of the mesh's triangles cover each pixel, each drawn alone.
std::vector<int> countsDrawnAlone(const View& view, const Mesh& mesh, bool one_sided) {
    std::vector<int> count(size_t(view.size().width) * view.size().height, 0);
    Rasteriser rasteriser(view, Lattice{}, 1, {});
    for (size_t i = 0; i < mesh.triangleCount(); ++i) {
        const Mesh one = part(mesh, i, i + 1);
        const DrawPatch patch{&one, one_sided, 0, {}, 0};
        rasteriser.restart(view, Lattice{}, {});
        rasteriser.draw({&patch, 1});
        const Picture& picture = rasteriser.finish();
        for (size_t k = 0; k < count.size(); ++k) count[k] += picture.depth[k] != kNothing;
    }
    return count;
}

/// A camera on +z that sees lattice points of plane z = 0 as pixels: x right, y up, one unit is
/// `pixels_per_unit`.
View flatView(int width, int height, double pixels_per_unit, const Vec3d& centre) {
    const double fovy = 30;
    const double focal = height / (2 * std::tan(fovy * std::numbers::pi / 360));
    const Camera camera{centre + Vec3d(0, 0, focal / pixels_per_unit), centre, {0, 1, 0}, fovy};
    return View(camera, {width, height}, Lattice{});
}

Mesh randomTriangles(std::mt19937& random, int count, int extent, int smallest, int largest) {
    Mesh mesh;
    std::uniform_int_distribution<int> place(0, extent), size(smallest, largest);
    for (int i = 0; i < count; ++i) {
        const int s = size(random);
        std::uniform_int_distribution<int> offset(-s, s);
        const Vec3i centre(place(random), place(random), offset(random));
        for (int k = 0; k < 3; ++k)
            mesh.position.push_back(centre + Vec3i(offset(random), offset(random), 0));
        const auto v = uint32_t(3 * i);
        mesh.triangle.push_back({v, v + 1, v + 2});
    }
    computeNormals(mesh);
    return mesh;
}

TEST(Rasteriser, CoversWhatTheExactReferenceCovers) {
    std::mt19937 random(1);
    // From below a pixel to far beyond the picture; lattice points often fall on pixel centres and
    // half pixels, so that the rule for edges matters.
    for (const double scale : {0.5, 0.125, 1.0 / 256, 2.0})
        for (const int largest : {3, 40, 4000}) {
            const View view = flatView(57, 43, scale, Vec3d(1000, 1000, 0));
            const Mesh mesh = [&] {
                Mesh m = randomTriangles(random, 60, int(60 / scale), 1, largest);
                for (Vec3i& p : m.position)
                    p += Vec3i(1000 - int(30 / scale), 1000 - int(30 / scale), 0);
                return m;
            }();
            EXPECT_EQ(countsDrawnAlone(view, mesh, false), coverageCounts(view, mesh))
                << scale << " " << largest;
        }
}

TEST(Rasteriser, TessellatedRectanglesAreCoveredOnceWhateverTheTessellation) {
    std::mt19937 random(2);
    for (int round = 0; round < 6; ++round) {
        const double unit = 32;  // lattice units a pixel
        Mesh mesh =
            grid(9, 7, [&](double u, double v) { return Vec3d(u * 40 * unit, v * 30 * unit, 0); });
        if (round % 2 == 0) {
            std::uniform_int_distribution<int> shift(-20, 20);  // folds no triangle over
            for (int j = 1; j < 7; ++j)
                for (int i = 1; i < 9; ++i)
                    mesh.position[j * 10 + i] += Vec3i(shift(random), shift(random), 0);
        } else {  // columns and rows anywhere: slivers, and triangles without area
            std::vector<int> column{0, 40 * 32}, row{0, 30 * 32};
            for (int i = 1; i < 9; ++i) column.push_back(int(random() % (40 * 32 + 1)));
            for (int j = 1; j < 7; ++j) row.push_back(int(random() % 30) * 32 + 16 * (j % 2));
            std::sort(column.begin(), column.end());
            std::sort(row.begin(), row.end());
            for (int j = 0; j <= 7; ++j)
                for (int i = 0; i <= 9; ++i) mesh.position[j * 10 + i] = {column[i], row[j], 0};
        }
        const View view = flatView(60, 50, 1 / unit, Vec3d(20 * unit, 15 * unit, 0));
        // 40 x 30 pixels around the centre of a 60 x 50 picture.
        std::vector<int> expected(60 * 50, 0);
        for (int y = 10; y < 40; ++y)
            for (int x = 10; x < 50; ++x) expected[y * 60 + x] = 1;
        EXPECT_EQ(countsDrawnAlone(view, mesh, true), expected) << round;
        EXPECT_EQ(covered(render(view, mesh)), expected);
    }
}

TEST(Rasteriser, ClosedSurfacesHaveAsManyFrontsAsBacks) {
    Mesh mesh = sphere({500, 500, 500}, 200, 24, 16);
    Mesh inside_out = mesh;
    for (Triangle& t : inside_out.triangle) std::swap(t[1], t[2]);
    const Camera camera{{500, -400, 600}, {500, 500, 500}, {0, 0, 1}, 40};
    const View view(camera, {70, 60}, Lattice{});
    const std::vector<int> front = countsDrawnAlone(view, mesh, true);
    EXPECT_EQ(front, countsDrawnAlone(view, inside_out, true));
    EXPECT_GT(std::count(front.begin(), front.end(), 1), 500);
    EXPECT_EQ(std::count(front.begin(), front.end(), 2), 0);  // convex
}

TEST(Rasteriser, FromInsideAClosedSurfaceNoPixelIsMissedOrDoubled) {
    std::mt19937 random(3);
    std::uniform_real_distribution<double> uniform(-1, 1);
    for (int round = 0; round < 30; ++round) {
        // A coarse sphere around an eye that may be very near to the surface.
        const Mesh mesh = sphere({1000, 1000, 1000}, 300, 7, 5);
        const Vec3d direction =
            glm::normalize(Vec3d(uniform(random), uniform(random), uniform(random)));
        const double reach = round % 3 == 0 ? 0 : round % 3 == 1 ? 150 : 215;
        const Camera camera{
            Vec3d(1000, 1000, 1000) + direction * reach,
            Vec3d(1000, 1000, 1000) + Vec3d(uniform(random), uniform(random), 300.0),
            {1, 0, 0},
            100};
        const View view(camera, {64, 48}, Lattice{});
        const std::vector<int> count = countsDrawnAlone(view, mesh, false);
        EXPECT_EQ(std::count(count.begin(), count.end(), 1), 64 * 48) << round;
    }
}

// Pictures as a whole.

/// A scene with everything in it: micro-triangles, large ones, some before and behind the eye, open
/// and closed, coloured and plain.
struct Scene {
    std::vector<Mesh> meshes;
    std::vector<DrawPatch> patches;
    View view{Camera{{500, -700, 900}, {520, 600, 300}, {0, 0, 1}, 60}, {161, 123}, Lattice{}};

    Scene() {
        meshes.push_back(terrain(60, 50, 1000, 300));
        meshes.push_back(sphere({300, 300, 500}, 120, 90, 60));
        meshes.push_back(sphere({600, 500, 400}, 150, 7, 5));
        meshes.push_back(grid(1, 1, [](double u, double v) {
            return Vec3d(6000 * u - 2500, 9000 * v - 6000, 150 + 100 * u);
        }));
        meshes.push_back(sphere({500, -700, 900}, 40, 12, 8));
        meshes[1].colour.resize(meshes[1].vertexCount());
        for (size_t i = 0; i < meshes[1].vertexCount(); ++i)
            meshes[1].colour[i] = {uint8_t(i * 7), uint8_t(i * 3), uint8_t(255 - i), 255};
        // The last one, around the eye, from behind only: seen from inside it draws nothing.
        for (size_t i = 0; i < meshes.size(); ++i)
            patches.push_back({&meshes[i], i == 1 || i == 4, uint32_t(i), {}, float(i)});
    }
};

void expectSame(const Picture& a, const Picture& b, const std::string& what) {
    EXPECT_EQ(a.depth, b.depth) << what;
    size_t different = 0;
    for (size_t i = 0; i < a.colour.size(); ++i) different += a.colour[i] != b.colour[i];
    EXPECT_EQ(different, 0u) << what;
}

TEST(Picture, DoesNotDependOnThreadsOrSimdLevel) {
    const Scene scene;
    for (const int samples : {1, 4}) {
        const Picture expected = render(scene.view, scene.patches, samples);
        for (const int threads : {1, 2, 7}) {
            const ThreadLimit limit(threads);
            expectSame(render(scene.view, scene.patches, samples), expected,
                       std::to_string(threads) + " threads");
        }
        for (const int64_t target : hwy::SupportedAndGeneratedTargets()) {
            hwy::SetSupportedTargetsForTest(target);
            hwy::GetChosenTarget().Update(hwy::SupportedTargets());
            expectSame(render(scene.view, scene.patches, samples), expected,
                       hwy::TargetName(target));
            hwy::SetSupportedTargetsForTest(0);
            hwy::GetChosenTarget().Update(hwy::SupportedTargets());
        }
    }
}

TEST(Picture, DoesNotDependOnHowTheListIsCutIntoCalls) {
    const Scene scene;
    for (const int samples : {1, 4}) {
        const Picture expected = render(scene.view, scene.patches, samples);
        Rasteriser rasteriser(scene.view, Lattice{}, samples, {});
        for (const DrawPatch& patch : scene.patches)
            for (size_t begin = 0; begin < patch.mesh->triangleCount(); begin += 500) {
                // The mesh is gone as soon as it is drawn.
                const Mesh piece =
                    part(*patch.mesh, begin, std::min(begin + 500, patch.mesh->triangleCount()));
                DrawPatch small = patch;
                small.mesh = &piece;
                rasteriser.draw({&small, 1});
            }
        rasteriser.draw({});
        expectSame(rasteriser.finish(), expected, std::to_string(samples));
        // And again in the same memory.
        rasteriser.restart(scene.view, Lattice{}, {});
        rasteriser.draw(scene.patches);
        expectSame(rasteriser.finish(), expected, "restarted");
    }
}

TEST(Picture, DrawnAllAtOnceIsTheSame) {
    const Scene scene;
    const Lattice lattice;
    for (const int samples : {1, 4})
        for (const Show show : {Show::kShaded, Show::kDepth})
            for (const size_t count : {scene.patches.size(), size_t(1), size_t(0)}) {
                ShadeSettings settings;
                settings.show = show;
                const std::span patches = std::span(scene.patches).first(count);
                const ModelPatches model{scene.view, &lattice, patches};
                Rasteriser rasteriser(scene.view, lattice, samples, settings);
                rasteriser.draw(patches);
                const Picture expected = rasteriser.finish();
                const uint64_t covered = rasteriser.statistics().pixels_covered;
                for (const bool leave_out_hidden : {false, true, false}) {
                    rasteriser.restart(scene.view, lattice, settings);
                    const std::string name = std::to_string(samples) + std::to_string(count);
                    expectSame(rasteriser.drawAll({&model, 1}, leave_out_hidden), expected, name);
                    EXPECT_EQ(rasteriser.statistics().pixels_covered, covered);
                }
            }
}

TEST(Picture, DoesNotDependOnHowManyBatchesAListTakes) {
    const Scene scene;
    const Picture expected = render(scene.view, scene.patches, 1);
    size_t vertices = 0;
    for (const Mesh& mesh : scene.meshes) vertices += mesh.vertexCount();
    // Of equal depths the first wins: what comes again changes nothing.
    std::vector<DrawPatch> again;
    for (size_t held = 0; held < 2'500'000; held += vertices)
        again.insert(again.end(), scene.patches.begin(), scene.patches.end());
    const Lattice lattice;
    const std::vector<ModelPatches> models = {{scene.view, &lattice, again},
                                              {scene.view, &lattice, scene.patches}};
    for (const bool leave_out_hidden : {false, true}) {
        Rasteriser rasteriser(scene.view, lattice, 1, {});
        rasteriser.draw(models, leave_out_hidden);
        expectSame(rasteriser.finish(), expected, std::to_string(leave_out_hidden));
        rasteriser.restart(scene.view, lattice, {});
        expectSame(rasteriser.drawAll(models, leave_out_hidden), expected, "at once");
        EXPECT_EQ(rasteriser.statistics().patches, again.size() + scene.patches.size());
    }
}

TEST(Picture, IsTheSameWhereverOnEarthTheModelLies) {
    const Scene scene;
    const Camera camera{{500, -700, 900}, {520, 600, 300}, {0, 0, 1}, 60};
    const Picture expected = render(scene.view, scene.patches);
    Lattice lattice;
    lattice.origin = Vec3d(4.5e6, 5.6e6, -1.0e5);
    lattice.step = 0.125;
    const auto moved = [&](const Vec3d& p) { return lattice.toInput(p); };
    const View view(Camera{moved(camera.eye), moved(camera.target), camera.up, camera.fovy_deg},
                    {161, 123}, lattice);
    Rasteriser rasteriser(view, lattice, 1, {});
    rasteriser.draw(scene.patches);
    const Picture& picture = rasteriser.finish();
    EXPECT_EQ(covered(picture), covered(expected));
    for (size_t i = 0; i < expected.depth.size(); ++i) {
        ASSERT_EQ(picture.colour[i], expected.colour[i]);
        if (expected.depth[i] != kNothing) {
            ASSERT_EQ(picture.depth[i], expected.depth[i] * 0.125f);
        }
    }
}

TEST(Picture, ModelsOnDifferentLatticesHideEachOther) {
    const Scene scene;
    const Camera camera{{500, 20, 900}, {520, 900, 100}, {0, 0, 1}, 80};
    const View view(camera, {161, 123}, Lattice{});
    const Picture expected = render(view, scene.patches);
    // The first three meshes on a lattice of half the step, and shifted.
    Lattice fine;
    fine.origin = Vec3d(-64, -128, -256);
    fine.step = 0.5;
    std::vector<Mesh> meshes(scene.meshes.begin(), scene.meshes.begin() + 3);
    std::vector<DrawPatch> patches(scene.patches.begin(), scene.patches.begin() + 3);
    for (size_t i = 0; i < 3; ++i) {
        for (Vec3i& p : meshes[i].position) p = 2 * (p + Vec3i(64, 128, 256));
        patches[i].mesh = &meshes[i];
    }
    Rasteriser rasteriser(view, Lattice{}, 1, {});
    rasteriser.setModel(View(camera, {161, 123}, fine), fine);
    rasteriser.draw(patches);
    rasteriser.setModel(view, Lattice{});
    rasteriser.draw(std::span(scene.patches).subspan(3));
    expectSame(rasteriser.finish(), expected, "two lattices");
}

/// What a ray through the pixel's centre meets first; negative where it passes within `margin`
/// (relative to the triangle's size in the picture) of an edge.
float traced(const View& view, std::span<const DrawPatch> patches, int x, int y, double margin) {
    const Vec3d ray = view.right() * ((x + 0.5 - view.size().width * 0.5) / view.focal_px()) -
                      view.up() * ((y + 0.5 - view.size().height * 0.5) / view.focal_px()) -
                      view.back();
    double nearest = kNothing;
    for (const DrawPatch& patch : patches)
        for (const Triangle& t : patch.mesh->triangle) {
            Vec3d v[3];
            for (int k = 0; k < 3; ++k) v[k] = Vec3d(patch.mesh->position[t[k]]) - view.eye();
            const Vec3d n = glm::cross(v[1] - v[0], v[2] - v[0]);
            const double depth = glm::dot(n, v[0]) / glm::dot(n, ray);
            if (!(depth > kNearDepth)) continue;
            if (patch.one_sided && glm::dot(n, ray) > 0) continue;
            double least = 1e300;
            for (int k = 0; k < 3; ++k) {
                const Vec3d a = v[k], b = v[(k + 1) % 3];
                const Vec3d side = glm::cross(b - a, ray * depth - a);
                least = std::min(least, glm::dot(side, n) / (glm::length(n) * glm::length(b - a)) /
                                            depth * view.focal_px());
            }
            if (std::abs(least) < margin) return -1;
            if (least > 0) nearest = std::min(nearest, depth);
        }
    return float(nearest);
}

TEST(Picture, ShowsWhatRaysMeet) {
    Scene scene;
    // Close to the ground, so that many triangles reach behind the eye.
    for (const Camera& camera : {Camera{{500, -700, 900}, {520, 600, 300}, {0, 0, 1}, 60},
                                 Camera{{410, 420, 250}, {700, 500, 180}, {0, 0, 1}, 110},
                                 Camera{{100, 800, 310}, {600, 100, 150}, {0, 0, 1}, 80}}) {
        const View view(camera, {67, 53}, Lattice{});
        const Picture picture = render(view, scene.patches);
        int compared = 0, covered = 0;
        for (int y = 0; y < 53; ++y)
            for (int x = 0; x < 67; ++x) {
                // Grazing triangles: a vertex moved by half a 1/256 pixel moves a depth by more.
                const float expected = traced(view, scene.patches, x, y, 0.02);
                if (expected < 0) continue;
                ++compared;
                const float depth = picture.depth[picture.index(x, y)];
                if (expected == kNothing) {
                    EXPECT_EQ(depth, kNothing) << x << " " << y;
                } else {
                    ++covered;
                    EXPECT_NEAR(depth / expected, 1, 0.01) << x << " " << y;
                }
            }
        EXPECT_GT(compared, 67 * 53 * 2 / 3);
        EXPECT_GT(covered, 500);
    }
}

TEST(Picture, OneSidedPatchesAreCulledUnlessTheSettingsSayOtherwise) {
    const Mesh mesh = grid(2, 2, [](double u, double v) { return Vec3d(1000 * v, 1000 * u, 0); });
    const View view = flatView(40, 40, 0.02, {500, 500, 0});  // sees the backs
    const DrawPatch one{&mesh, true, 0, {}, 0}, both{&mesh, false, 0, {}, 0};
    ShadeSettings settings;
    EXPECT_EQ(std::ranges::count(covered(render(view, {&one, 1}, 1, settings)), 1), 0);
    EXPECT_EQ(std::ranges::count(covered(render(view, {&both, 1}, 1, settings)), 1), 400);
    settings.two_sided = true;
    EXPECT_EQ(std::ranges::count(covered(render(view, {&one, 1}, 1, settings)), 1), 400);
}

TEST(Picture, BothSidesAreLitAlike) {
    const auto plane = [](double u, double v) { return Vec3d(1000 * u, 1000 * v, 0); };
    const Mesh front = grid(2, 2, plane);
    Mesh back = front;
    for (Triangle& t : back.triangle) std::swap(t[1], t[2]);
    computeNormals(back);
    const View view = flatView(40, 40, 0.02, {500, 500, 0});
    const Picture a = render(view, front), b = render(view, back);
    EXPECT_EQ(a.colour, b.colour);
    EXPECT_GT(a.colour[a.index(20, 20)].r, 120);
}

TEST(Picture, ColoursAreInterpolatedInPerspectiveAlsoAcrossTheEye) {
    // A long floor from behind the eye to the horizon, red to the left and green to the right, as
    // two triangles and as many: the same colours, whatever is clipped.
    const auto floor = [](double u, double v) { return Vec3d(16000 * u, 64000 * v, 0); };
    const auto coloured = [&](int columns, int rows) {
        Mesh mesh = grid(columns, rows, floor);
        for (int j = 0; j <= rows; ++j)
            for (int i = 0; i <= columns; ++i) {
                const float t = float(i) / float(columns);
                mesh.colour.push_back(srgbFromLinear(Vec3f(1 - t, t, float(j) / float(rows))));
            }
        return mesh;
    };
    const Mesh coarse = coloured(1, 1), fine = coloured(16, 64);
    const View view(Camera{{8000, 8000, 900}, {8300, 30000, 500}, {0, 0, 1}, 70}, {80, 60},
                    Lattice{});
    ShadeSettings settings;
    settings.show = Show::kColour;
    const DrawPatch a{&coarse, false, 0, {}, 0}, b{&fine, false, 0, {}, 0};
    const Picture one = render(view, {&a, 1}, 1, settings),
                  many = render(view, {&b, 1}, 1, settings);
    EXPECT_EQ(covered(one), covered(many));
    for (size_t i = 0; i < one.colour.size(); ++i) {
        EXPECT_NEAR(one.colour[i].r, many.colour[i].r, 2) << i;
        EXPECT_NEAR(one.colour[i].g, many.colour[i].g, 2) << i;
        EXPECT_NEAR(one.colour[i].b, many.colour[i].b, 3) << i;
    }
}

TEST(Picture, FourSamplesAverageInLinearLight) {
    // A white and a black square side by side; their border runs through the middle of a pixel.
    const Mesh mesh = grid(2, 1, [](double u, double v) { return Vec3d(6400 * u, 3200 * v, 0); });
    std::vector<Mesh> halves{part(mesh, 0, 2), part(mesh, 2, 4)};
    halves[0].colour.assign(halves[0].vertexCount(), Rgba8{255, 255, 255, 255});
    halves[1].colour.assign(halves[1].vertexCount(), Rgba8{0, 0, 0, 255});
    const std::vector<DrawPatch> patches{{&halves[0], false, 0, {}, 0},
                                         {&halves[1], false, 1, {}, 0}};
    const View view = flatView(15, 9, 0.005, {3200, 1600, 0});
    ShadeSettings settings;
    settings.show = Show::kColour;
    const Picture picture = render(view, patches, 4, settings);
    EXPECT_EQ(picture.colour[picture.index(6, 4)].g, 255);
    EXPECT_EQ(picture.colour[picture.index(8, 4)].g, 0);
    EXPECT_EQ(picture.colour[picture.index(7, 4)].g, srgbFromLinear(0.5f));
}

TEST(Picture, ViewsShowWhatTheyName) {
    Scene scene;
    scene.meshes[0].scalar.resize(scene.meshes[0].vertexCount() * 2);
    for (size_t i = 0; i < scene.meshes[0].vertexCount(); ++i)
        scene.meshes[0].scalar[2 * i + 1] = float(scene.meshes[0].position[i].x);
    std::vector<Picture> seen;
    for (const Show show :
         {Show::kShaded, Show::kNormals, Show::kDepth, Show::kLod, Show::kPatches, Show::kTriangles,
          Show::kError, Show::kColour, Show::kScalar, Show::kWire}) {
        ShadeSettings settings;
        settings.show = show;
        settings.scalar_count = 2;
        settings.scalar_index = 1;
        settings.scalar_max = 1000;
        settings.value_max = 4;
        const Picture picture = render(scene.view, scene.patches, 1, settings);
        for (const Picture& other : seen) {
            EXPECT_EQ(other.depth, picture.depth);
            EXPECT_NE(other.colour, picture.colour);
        }
        seen.push_back(picture);
    }
}

TEST(Picture, EmptyListsAndEmptyMeshesGiveBackground) {
    const View view = flatView(7, 5, 1, {0, 0, 0});
    const Mesh nothing;
    const DrawPatch patch{&nothing, false, 0, {}, 0};
    ShadeSettings settings;
    settings.background_top = settings.background_bottom = {10, 20, 30, 255};
    const Picture picture = render(view, {&patch, 1}, 4, settings);
    EXPECT_EQ(picture.colour, std::vector<Rgba8>(35, Rgba8{10, 20, 30, 255}));
    EXPECT_EQ(picture.depth, std::vector<float>(35, kNothing));
}

TEST(Picture, StatisticsCountWhatWasDrawn) {
    const Scene scene;
    Rasteriser rasteriser(scene.view, Lattice{}, 1, {});
    rasteriser.draw(scene.patches);
    const Picture& picture = rasteriser.finish();
    size_t triangles = 0;
    for (const Mesh& mesh : scene.meshes) triangles += mesh.triangleCount();
    EXPECT_EQ(rasteriser.statistics().patches, scene.patches.size());
    EXPECT_EQ(rasteriser.statistics().triangles, triangles);
    EXPECT_EQ(rasteriser.statistics().pixels_covered,
              uint64_t(std::ranges::count(covered(picture), 1)));
    EXPECT_GT(rasteriser.statistics().totalMs(), 0);
}

/// A plane that goes on behind the eye, from above or from below.
TEST(Picture, ATriangleAtTheEyeIsTrueFarAwayAndLitFromItsOwnSide) {
    const Mesh ground = grid(
        1, 1, [](double u, double v) { return Vec3d(12000 * u - 6000, 9000 * v - 6000, 100); });
    for (const double height : {900.0, 80.0}) {
        const Camera camera{{0, 0, height}, {0, 1000, height}, {0, 0, 1}, 60};
        const View view(camera, {161, 123}, Lattice{});
        const Picture picture = render(view, ground);
        ShadeSettings normals;
        normals.show = Show::kNormals;
        const DrawPatch patch{&ground, false, 0, {}, 0};
        const Picture facing = render(view, {&patch, 1}, 1, normals);
        size_t seen = 0;
        for (int y = 0; y < 123; ++y)
            for (int x = 0; x < 161; ++x) {
                const size_t i = picture.index(x, y);
                if (picture.depth[i] == kNothing) continue;
                const double down = (y + 0.5 - 61.5) / view.focal_px();
                const double depth = (height - 100) / down;
                // What moving the horizon by 1/256 pixel would do.
                ASSERT_NEAR(picture.depth[i], depth, depth / (256 * std::abs(y + 0.5 - 61.5)))
                    << x << " " << y;
                ASSERT_EQ(facing.colour[i].g > 127, height > 100) << x << " " << y;
                ++seen;
            }
        EXPECT_GT(seen, 5000u);
    }
}

}  // namespace
}  // namespace pietra
