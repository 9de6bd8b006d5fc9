#include "render/gl/renderer.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "base/check.h"
#include "gpu/test_context.h"
#include "render/gl/test_pictures.h"
#include "render/raster/rasteriser.h"
#include "render/raster/test_meshes.h"

namespace pietra {
namespace {

using namespace test_meshes;

constexpr size_t kVram = size_t(1) << 26;

/// Meshes with the way they are drawn; they are moved so that all coordinates are on the lattice.
struct Scene {
    static constexpr Vec3i kShift{1 << 20, 1 << 20, 1 << 20};
    std::deque<Mesh> meshes;
    std::vector<DrawPatch> patches;
    Camera camera;
    PictureSize size{320, 256};

    Mesh& add(Mesh mesh, bool one_sided = false) {
        for (Vec3i& p : mesh.position) p += kShift;
        meshes.push_back(std::move(mesh));
        const auto id = uint32_t(patches.size());
        patches.push_back({&meshes.back(), one_sided, id, {}, float(id), {0, id}, 0});
        return meshes.back();
    }
    void look(const Vec3d& eye, const Vec3d& target, double fovy_deg) {
        camera = {eye + Vec3d(kShift), target + Vec3d(kShift), {0, 0, 1}, fovy_deg};
    }
    View view(const Lattice& lattice = {}) const { return View(camera, size, lattice); }
};

void colourVertices(Mesh& mesh) {
    for (const Vec3i& p : mesh.position) {
        const Vec3i q = p - Scene::kShift;
        mesh.colour.push_back(
            {uint8_t(q.x / 4 & 255), uint8_t(255 - (q.y / 4 & 255)), uint8_t(q.z / 4 & 255), 255});
    }
}

void addScalars(Mesh& mesh) {
    for (const Vec3i& p : mesh.position) {
        mesh.scalar.push_back(-1e9f);
        mesh.scalar.push_back(float(p.z - Scene::kShift.z));
    }
}

/// Everything: micro-triangles, large ones, some before and behind the eye, open and closed,
/// coloured and plain.
Scene variedScene() {
    Scene scene;
    addScalars(scene.add(terrain(60, 50, 1000, 300)));
    colourVertices(scene.add(sphere({300, 300, 500}, 120, 90, 60), true));
    scene.add(sphere({600, 500, 400}, 150, 7, 5));
    Mesh& both = scene.add(grid(1, 1, [](double u, double v) {
        return Vec3d(6000 * u - 2500, 9000 * v - 6000, 150 + 100 * u);
    }));
    colourVertices(both);
    addScalars(both);
    scene.add(sphere({500, -700, 900}, 40, 12, 8), true);  // around the eye, from behind only
    scene.look({500, -700, 900}, {520, 600, 300}, 60);
    return scene;
}

Picture drawOnCpu(const Scene& scene, int samples, const ShadeSettings& settings) {
    Rasteriser rasteriser(scene.view(), Lattice{}, samples, settings);
    rasteriser.draw(scene.patches);
    return rasteriser.finish();
}

/// Uploads each mesh as a page, draws all, releases them.
Picture drawOnGpu(GlRenderer& renderer, const Scene& scene, const ShadeSettings& settings) {
    const std::vector<DrawPatch> items = scene.patches;
    for (uint32_t i = 0; i < items.size(); ++i)
        EXPECT_TRUE(renderer.upload(items[i].page, {scene.patches[i].mesh, 1}));
    renderer.begin(scene.view(), Lattice{}, settings);
    renderer.draw(items);
    for (const DrawPatch& item : items) renderer.release(item.page);
    return renderer.readPicture();
}

using GlRendererTest = GlTest;

TEST_F(GlRendererTest, DrawsWhatTheCpuDrawsInEveryView) {
    const Scene scene = variedScene();
    for (const int samples : {1, 4}) {
        GlRenderer renderer(scene.size, samples, kVram);
        for (const Show show :
             {Show::kShaded, Show::kNormals, Show::kDepth, Show::kLod, Show::kPatches,
              Show::kTriangles, Show::kError, Show::kColour, Show::kScalar, Show::kWire}) {
            ShadeSettings settings;
            settings.show = show;
            settings.scalar_count = 2;
            settings.scalar_index = 1;
            settings.scalar_min = 20;
            settings.scalar_max = 250;
            settings.value_max = 4;
            expectAlike(
                drawOnCpu(scene, samples, settings), drawOnGpu(renderer, scene, settings),
                "show " + std::to_string(int(show)) + ", " + std::to_string(samples) + " samples");
        }
    }
}

TEST_F(GlRendererTest, LargeTrianglesAreTheSameInside) {
    // Each triangle in a colour of its own, all with one normal: edges are where colours change.
    Scene scene;
    for (const Mesh& mesh : {sphere({600, 500, 400}, 350, 7, 5), grid(2, 2, [](double u, double v) {
                                 return Vec3d(3000 * u - 1000, 3000 * v - 1000, 300 + 100 * u);
                             })})
        for (size_t i = 0; i < mesh.triangleCount(); ++i)
            for (OctNormal& n : scene.add(part(mesh, i, i + 1)).normal) n = encodeNormal({0, 0, 1});
    scene.look({500, -700, 900}, {520, 600, 300}, 60);
    ShadeSettings settings;
    settings.show = Show::kPatches;
    settings.two_sided = true;
    for (const int samples : {1, 4}) {
        GlRenderer renderer(scene.size, samples, kVram);
        const Picture cpu = drawOnCpu(scene, samples, settings),
                      gpu = drawOnGpu(renderer, scene, settings);
        size_t inside = 0;
        for (int y = 1; y + 1 < scene.size.height; ++y)
            for (int x = 1; x + 1 < scene.size.width; ++x) {
                int change = 0;
                const Rgba8& c = cpu.colour[cpu.index(x, y)];
                for (const auto& [u, v] : {std::pair(x - 1, y), std::pair(x + 1, y),
                                           std::pair(x, y - 1), std::pair(x, y + 1)}) {
                    const Rgba8& other = cpu.colour[cpu.index(u, v)];
                    change = std::max({change, std::abs(c.r - other.r), std::abs(c.g - other.g),
                                       std::abs(c.b - other.b)});
                }
                if (change > 2) continue;
                ++inside;
                const Rgba8& g = gpu.colour[gpu.index(x, y)];
                ASSERT_LE(std::max({std::abs(c.r - g.r), std::abs(c.g - g.g), std::abs(c.b - g.b)}),
                          1)
                    << x << " " << y;
                ASSERT_EQ(covered(gpu, x, y), covered(cpu, x, y)) << x << " " << y;
            }
        EXPECT_GT(inside, cpu.pixelCount() * 8 / 10);
    }
}

TEST_F(GlRendererTest, LeavesOutBacksOnlyWhereTheCpuDoes) {
    // Open caps and a mesh inside out, from both sides.
    Scene scene;
    const Mesh ball = sphere({500, 500, 500}, 300, 40, 24);
    scene.add(part(ball, 0, ball.triangleCount() / 2), true);
    scene.add(part(ball, ball.triangleCount() / 4, ball.triangleCount()), false);
    Mesh& turned = scene.add(sphere({800, 300, 700}, 150, 9, 7), true);
    for (Triangle& t : turned.triangle) std::swap(t[1], t[2]);
    for (const int samples : {1, 4}) {
        GlRenderer renderer(scene.size, samples, kVram);
        for (const Vec3d& eye : {Vec3d(500, -900, 1200), Vec3d(600, 1700, -100)})
            for (const bool two_sided : {false, true}) {
                scene.look(eye, {500, 500, 500}, 50);
                ShadeSettings settings;
                settings.two_sided = two_sided;
                expectAlike(drawOnCpu(scene, samples, settings),
                            drawOnGpu(renderer, scene, settings),
                            std::to_string(eye.y) + (two_sided ? ", two-sided" : ""));
            }
    }
}

TEST_F(GlRendererTest, CutsWhatIsTooNearWhereTheCpuCutsIt) {
    std::mt19937 random(5);
    std::uniform_real_distribution<double> uniform(-1, 1);
    GlRenderer renderer({160, 120}, 1, kVram);
    for (int round = 0; round < 12; ++round) {
        // A coarse sphere around an eye that may be within a lattice unit of it, and a plane
        // through the eye, or almost.
        Scene scene;
        scene.size = {160, 120};
        const Vec3d centre(1000, 1000, 1000);
        scene.add(sphere(centre, 300, 7, 5));
        scene.add(grid(2, 2, [&](double u, double v) {
            return centre + Vec3d(2000 * u - 900, 2000 * v - 900, round % 4 - 1);
        }));
        const double reach[] = {0, 100, 215};
        const Vec3d to = glm::normalize(Vec3d(uniform(random), uniform(random), 0.01));
        scene.look(centre + to * reach[round % 3], centre + 300.0 * Vec3d(to.y, to.x, 0.3), 80);
        // Depths on the CPU suffer where a lattice unit is many pixels: 1/256 pixel is much then.
        expectAlike(drawOnCpu(scene, 1, {}), drawOnGpu(renderer, scene, {}),
                    "round " + std::to_string(round), 1e-2f);
    }
}

TEST_F(GlRendererTest, JoinsPatchesWithoutASeam) {
    // One surface as a mesh and as many patches with corners of their own: the same pixels.
    Scene whole, pieces;
    const Mesh mesh = terrain(70, 60, 4000, 900);
    whole.add(mesh);
    for (size_t begin = 0; begin < mesh.triangleCount(); begin += 37)
        pieces.add(part(mesh, begin, std::min(begin + 37, mesh.triangleCount())));
    for (Scene* scene : {&whole, &pieces}) scene->look({1500, -1000, 2500}, {2000, 2000, 300}, 60);
    for (const int samples : {1, 4}) {
        // Memory so scarce that the lists go through the ring in several parts.
        GlRenderer renderer(whole.size, samples, kLeastVramBytes);
        const Picture expected = drawOnGpu(renderer, whole, {});
        expectSame(drawOnGpu(renderer, pieces, {}), expected, std::to_string(samples));
    }
}

TEST_F(GlRendererTest, AModelMayLieAnywhereOnTheLatticeAndOnEarth) {
    const Scene scene = variedScene();
    GlRenderer renderer(scene.size, 1, kVram);
    const Picture expected = drawOnGpu(renderer, scene, {});
    Lattice lattice;
    lattice.origin = Vec3d(4.5e6, 5.6e6, -1.0e5);
    lattice.step = 0.125;
    const auto moved = [&](const Vec3d& p) { return lattice.toInput(p); };
    const View view(Camera{moved(scene.camera.eye), moved(scene.camera.target), scene.camera.up,
                           scene.camera.fovy_deg},
                    scene.size, lattice);
    const std::vector<DrawPatch> items = scene.patches;
    for (uint32_t i = 0; i < items.size(); ++i)
        ASSERT_TRUE(renderer.upload(items[i].page, {scene.patches[i].mesh, 1}));
    renderer.begin(view, lattice, {});
    renderer.draw(items);
    const Picture picture = renderer.readPicture();
    EXPECT_EQ(picture.colour, expected.colour);
    for (size_t i = 0; i < expected.depth.size(); ++i)
        if (std::isfinite(expected.depth[i])) {
            ASSERT_EQ(picture.depth[i], expected.depth[i] * 0.125f);
        }
}

TEST_F(GlRendererTest, ModelsOnDifferentLatticesHideEachOther) {
    const Scene scene = variedScene();
    Lattice fine;
    fine.origin = Vec3d(Scene::kShift) - Vec3d(3000, 7000, 1000);
    fine.step = 0.25;
    std::vector<Mesh> meshes;
    for (size_t i = 0; i < 3; ++i) {
        meshes.push_back(scene.meshes[i]);
        for (Vec3i& p : meshes[i].position) p = 4 * (p - Vec3i(fine.origin));
    }
    GlRenderer renderer(scene.size, 1, kVram);
    const std::vector<DrawPatch> items = scene.patches;
    for (uint32_t i = 0; i < items.size(); ++i)
        ASSERT_TRUE(
            renderer.upload(items[i].page, {i < 3 ? &meshes[i] : scene.patches[i].mesh, 1}));
    renderer.begin(scene.view(), Lattice{}, {});
    renderer.draw(std::span(items).subspan(3));
    renderer.setModel(scene.view(fine), fine);
    renderer.draw(std::span(items).first(3));
    expectAlike(drawOnCpu(scene, 1, {}), renderer.readPicture(), "two lattices");
}

TEST_F(GlRendererTest, DrawsPagesOfSeveralPatchesAndLargeIndices) {
    Scene scene;
    scene.add(grid(300, 260, [](double u, double v) {  // more vertices than 16 bits number
        return Vec3d(1000 * u, 1000 * v, 300 + 60 * std::sin(9 * u) * std::cos(8 * v));
    }));
    scene.add(Mesh{});
    scene.add(sphere({500, 500, 400}, 200, 30, 20));
    scene.look({500, -700, 900}, {520, 600, 300}, 60);
    ASSERT_GT(scene.meshes[0].vertexCount(), size_t(1) << 16);
    const std::vector<Mesh> page(scene.meshes.begin(), scene.meshes.end());
    GlRenderer renderer(scene.size, 1, kVram);
    ASSERT_TRUE(renderer.upload({3, 7}, page));
    std::vector<DrawPatch> items;
    for (uint32_t i = 0; i < 3; ++i) items.push_back({nullptr, false, i, {}, 0, {3, 7}, i});
    renderer.begin(scene.view(), Lattice{}, {});
    renderer.draw(items);
    EXPECT_EQ(renderer.statistics().patches, 2u);
    EXPECT_EQ(renderer.statistics().triangles,
              scene.meshes[0].triangleCount() + scene.meshes[2].triangleCount());
    expectAlike(drawOnCpu(scene, 1, {}), renderer.readPicture(), "one page");
}

/// Random pieces of a surface come and go, in memory for a few of them, and each picture is that of
/// those which are there.
TEST_F(GlRendererTest, PagesComeAndGoInScarceMemory) {
    Scene scene;
    const Mesh mesh = terrain(300, 260, 4000, 900);
    std::mt19937 random(9);
    for (size_t begin = 0; begin < mesh.triangleCount();) {
        const size_t end = std::min(begin + 20 + random() % 3000, mesh.triangleCount());
        scene.add(part(mesh, begin, end));
        if (random() % 2) colourVertices(scene.meshes.back());
        begin = end;
    }
    scene.size = {160, 120};
    scene.look({1500, -1000, 2500}, {2000, 2000, 300}, 60);
    GlRenderer renderer(scene.size, 1, kLeastVramBytes);
    const std::vector<DrawPatch> items = scene.patches;
    std::vector<bool> there(items.size(), false);
    size_t refused = 0, uploads = 0;
    for (int step = 0; step < 1500; ++step) {
        const size_t i = random() % items.size();
        if (there[i]) {
            renderer.release(items[i].page);
            there[i] = false;
        } else {
            there[i] = renderer.upload(items[i].page, {scene.patches[i].mesh, 1});
            (there[i] ? uploads : refused)++;
        }
        ASSERT_EQ(renderer.holds(items[i].page), there[i]);
        ASSERT_LE(renderer.usedBytes(), renderer.capacityBytes());
        if (step % 100 != 99) continue;
        std::vector<DrawPatch> list;
        for (size_t k = 0; k < items.size(); ++k)
            if (there[k]) list.push_back(items[k]);
        renderer.begin(scene.view(), Lattice{}, {});
        renderer.draw(list);
        Rasteriser rasteriser(scene.view(), Lattice{}, 1, {});
        rasteriser.draw(list);
        expectAlike(rasteriser.finish(), renderer.readPicture(), "step " + std::to_string(step));
    }
    EXPECT_GT(refused, 50u);
    EXPECT_GT(uploads, 200u);
    for (size_t i = 0; i < items.size(); ++i)
        if (there[i]) renderer.release(items[i].page);
    EXPECT_EQ(renderer.usedBytes(), 0u);
}

/// A flight over a landscape of ridges and through a closed ball, in many patches that come and go.
TEST_F(GlRendererTest, LeavingOutWhatIsHiddenChangesNoPixel) {
    Scene scene;
    std::mt19937 random(3);
    for (const auto& [mesh, one_sided] : {std::pair(terrain(80, 70, 4000, 1500), false),
                                          std::pair(sphere({2500, 2500, 700}, 500, 60, 40), true)})
        for (size_t begin = 0; begin < mesh.triangleCount(); begin += 60)
            scene.add(part(mesh, begin, std::min(begin + 60, mesh.triangleCount())), one_sided);
    scene.size = {160, 128};
    std::vector<DrawPatch> items = scene.patches;
    for (const int samples : {1, 4}) {
        GlRenderer plain(scene.size, samples, kVram), culling(scene.size, samples, kVram);
        for (uint32_t i = 0; i < items.size(); ++i)
            for (GlRenderer* renderer : {&plain, &culling})
                ASSERT_TRUE(renderer->upload(items[i].page, {scene.patches[i].mesh, 1}));
        size_t submitted = 0, drawn = 0;
        for (int frame = 0; frame < 24; ++frame) {
            // Small steps, a jump now and then, some of the patches missing.
            const double t = frame * 0.04 + (frame / 8) * 0.3;
            scene.look({300 + 2800 * t, 100 + 2500 * t, 1400 - 500 * t},
                       {2600 + 500 * t, 2500, 600 + 300 * std::sin(9 * t)}, 70);
            std::shuffle(items.begin(), items.end(), random);
            const auto list = std::span(items).first(items.size() - size_t(frame % 5) * 20);
            plain.begin(scene.view(), Lattice{}, {});
            plain.draw(list);
            culling.begin(scene.view(), Lattice{}, {});
            std::vector<uint32_t> hidden;
            const bool all = frame % 3 == 0;  // else each in its turn
            culling.drawUnhidden(list, all ? &hidden : nullptr);
            submitted += all ? list.size() : 0;
            drawn += all ? list.size() - hidden.size() : 0;
            const Picture expected = plain.readPicture(), picture = culling.readPicture();
            expectSame(picture, expected, "frame " + std::to_string(frame));
        }
        EXPECT_LT(drawn, submitted * 4 / 5);
    }
}

/// Uploads a scene's meshes and draws it again and again; the pictures must be those of draw().
class Watcher {
public:
    explicit Watcher(Scene& scene)
        : scene_(scene), items_(scene.patches), renderer_(scene.size, 1, kVram) {
        for (uint32_t i = 0; i < items_.size(); ++i)
            EXPECT_TRUE(renderer_.upload(items_[i].page, {scene.patches[i].mesh, 1}));
    }
    /// How many patches were drawn.
    size_t look(const Vec3d& eye, const Vec3d& target) {
        scene_.look(eye, target, 60);
        renderer_.begin(scene_.view(), Lattice{}, {});
        std::vector<uint32_t> hidden;
        renderer_.drawUnhidden(items_, &hidden);
        const Picture picture = renderer_.readPicture();
        renderer_.begin(scene_.view(), Lattice{}, {});
        renderer_.draw(items_);
        expectSame(picture, renderer_.readPicture(), "unhidden");
        return items_.size() - hidden.size();
    }

private:
    Scene& scene_;
    std::vector<DrawPatch> items_;
    GlRenderer renderer_;
};

TEST_F(GlRendererTest, WhatAWallHidesIsNotDrawn) {
    Scene scene;
    scene.add(grid(4, 4, [](double u, double v) {  // y = 0
        return Vec3d(2000 * u - 1000, 0, 2000 * v - 1000);
    }));
    for (int i = 0; i < 20; ++i) scene.add(sphere({40.0 * i - 400, 300, 0}, 30, 8, 6));
    Watcher watcher(scene);
    const Vec3d before(0, -1500, 0), behind(100, 1500, 0), centre(0, 0, 0);
    EXPECT_EQ(watcher.look(before, centre), 21u);  // nobody knows yet
    EXPECT_EQ(watcher.look(before, centre), 21u);  // drawn as they were seen, and found hidden
    EXPECT_EQ(watcher.look(before, centre), 1u);
    EXPECT_EQ(watcher.look(behind, centre), 21u);
    EXPECT_EQ(watcher.look(before, centre), 21u);
    EXPECT_EQ(watcher.look(before, centre), 1u);
    EXPECT_EQ(watcher.look(before, {0, -3000, 0}), 1u);  // out of the picture
    EXPECT_EQ(watcher.look(before, {0, -3000, 0}), 0u);
}

TEST_F(GlRendererTest, APatchWhoseBoxHoldsTheEyeIsDrawn) {
    // The faces of its box that are in front are behind a wall; the patch itself is not.
    Scene scene;
    scene.add(grid(
        2, 2, [](double u, double v) { return Vec3d(6000 * u - 3000, 400, 6000 * v - 3000); }));
    scene.add(grid(8, 8, [](double u, double v) {
        const double x = 6000 * u - 3000;
        return Vec3d(x, 6000 * v - 3000, x - 150);
    }));
    Watcher watcher(scene);
    for (int i = 0; i < 4; ++i) EXPECT_EQ(watcher.look({0, 0, 0}, {0, 100, -20}), 2u);
}

TEST_F(GlRendererTest, WhatIsReleasedStaysInThePicture) {
    const Scene scene = variedScene();
    GlRenderer renderer(scene.size, 1, kVram);
    const Picture expected = drawOnGpu(renderer, scene, {});
    const std::vector<DrawPatch> items = scene.patches;
    renderer.begin(scene.view(), Lattice{}, {});
    for (uint32_t i = 0; i < items.size(); ++i) {
        ASSERT_TRUE(renderer.upload(items[i].page, {scene.patches[i].mesh, 1}));
        renderer.draw({&items[i], 1});
        renderer.release(items[i].page);
        // Another page takes its place at once.
        ASSERT_TRUE(renderer.upload({1, i}, {&scene.meshes[0], 1}));
        renderer.release({1, i});
    }
    EXPECT_EQ(renderer.statistics().patches, items.size());
    expectSame(renderer.readPicture(), expected, "one by one");
    EXPECT_EQ(renderer.usedBytes(), 0u);
}

TEST_F(GlRendererTest, EmptyPicturesAreTheBackgroundAndSizesMayChange) {
    Scene scene;
    scene.look({0, 0, 0}, {1, 1, 1}, 40);
    GlRenderer renderer({320, 200}, 4, kVram);
    for (const PictureSize size :
         {PictureSize{320, 200}, PictureSize{333, 7}, PictureSize{1, 1}, PictureSize{640, 480}}) {
        scene.size = size;
        renderer.resize(size, 4);
        ShadeSettings settings;
        settings.background_top.r = uint8_t(size.height);
        for (const Show show : {Show::kShaded, Show::kDepth}) {
            settings.show = show;
            expectSame(drawOnGpu(renderer, scene, settings), drawOnCpu(scene, 4, settings),
                       std::to_string(size.width));
        }
    }
}

/// A surface to make current, as a window has.
class Surface {
public:
    explicit Surface(const PictureSize& size) {
        const EGLint wanted[] = {EGL_SURFACE_TYPE,
                                 EGL_PBUFFER_BIT,
                                 EGL_RENDERABLE_TYPE,
                                 EGL_OPENGL_BIT,
                                 EGL_RED_SIZE,
                                 8,
                                 EGL_GREEN_SIZE,
                                 8,
                                 EGL_BLUE_SIZE,
                                 8,
                                 EGL_NONE};
        EGLConfig config = nullptr;
        EGLint count = 0;
        if (eglChooseConfig(display_, wanted, &config, 1, &count) != EGL_TRUE || count == 0) return;
        const EGLint extent[] = {EGL_WIDTH, size.width, EGL_HEIGHT, size.height, EGL_NONE};
        surface_ = eglCreatePbufferSurface(display_, config, extent);
    }
    ~Surface() {
        use(EGL_NO_SURFACE);
        if (surface_ != EGL_NO_SURFACE) eglDestroySurface(display_, surface_);
    }
    bool makeCurrent() { return surface_ != EGL_NO_SURFACE && use(surface_); }

private:
    bool use(EGLSurface surface) {
        return eglMakeCurrent(display_, surface, surface, context_) == EGL_TRUE;
    }
    EGLDisplay display_ = eglGetCurrentDisplay();
    EGLContext context_ = eglGetCurrentContext();
    EGLSurface surface_ = EGL_NO_SURFACE;
};

TEST_F(GlRendererTest, PresentsThePictureInAWindow) {
    const Scene scene = variedScene();
    Surface surface(scene.size);
    if (!surface.makeCurrent()) GTEST_SKIP() << "no surface that a window could be";
    const GlContext adopted = GlContext::adoptCurrent();
    for (const int samples : {1, 4}) {
        GlRenderer renderer(scene.size, samples, kVram);
        const Picture picture = drawOnGpu(renderer, scene, {});
        renderer.present();
        std::vector<Rgba8> shown(picture.pixelCount());
        glReadPixels(0, 0, scene.size.width, scene.size.height, GL_RGBA, GL_UNSIGNED_BYTE,
                     shown.data());
        size_t different = 0;
        for (int y = 0; y < scene.size.height; ++y)
            for (int x = 0; x < scene.size.width; ++x) {
                const Rgba8 &a = picture.colour[picture.index(x, y)],
                            &b = shown[picture.index(x, scene.size.height - 1 - y)];
                different += a.r != b.r || a.g != b.g || a.b != b.b;
            }
        EXPECT_EQ(different, 0u);
    }
}

TEST_F(GlRendererTest, TellsHowLongTheGpuTook) {
    const Scene scene = variedScene();
    GlRenderer renderer(scene.size, 1, kVram);
    EXPECT_EQ(renderer.statistics().gpu_ms, 0);
    for (int i = 0; i < 3; ++i) drawOnGpu(renderer, scene, {});
    EXPECT_GT(renderer.statistics().gpu_ms, 0);
    EXPECT_GT(renderer.statistics().triangles, 0u);
}

TEST_F(GlRendererTest, TellsWhatPicturesOfAnySizeHide) {
    Scene scene = variedScene();
    GlRenderer renderer(scene.size, 1, kVram);
    EXPECT_EQ(renderer.seen(), nullptr);
    for (const PictureSize size : {scene.size, PictureSize{321, 255}, PictureSize{7, 3}}) {
        scene.size = size;
        renderer.resize(size, 1);
        const Picture picture = drawOnGpu(renderer, scene, {});
        renderer.lookBack(scene.camera);
        renderer.wait();
        ASSERT_NE(renderer.seen(), nullptr);
        const SeenDepth expected = seenDepth(scene.camera, size, picture.depth);
        EXPECT_EQ(renderer.seen()->camera, scene.camera);
        EXPECT_EQ(renderer.seen()->size, size);
        EXPECT_EQ(renderer.seen()->farthest, expected.farthest);
    }
}

TEST_F(GlRendererTest, FindsFaultWithItsCaller) {
    const Scene scene = variedScene();
    GlRenderer renderer(scene.size, 1, kVram);
    EXPECT_THROW(renderer.release({0, 0}), BugError);
    renderer.begin(scene.view(), Lattice{}, {});
    const DrawPatch item{};
    EXPECT_THROW(renderer.draw({&item, 1}), BugError);
    ASSERT_TRUE(renderer.upload({0, 0}, {scene.patches[0].mesh, 1}));
    EXPECT_THROW(renderer.upload({0, 0}, {scene.patches[0].mesh, 1}), BugError);
}

}  // namespace
}  // namespace pietra
