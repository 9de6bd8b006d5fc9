#include "render/gl/renderer.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "base/check.h"
#include "render/gl/test_context.h"
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
        patches.push_back({&meshes.back(), one_sided, id, {}, float(id)});
        return meshes.back();
    }
    void look(const Vec3d& eye, const Vec3d& target, double fovy_deg) {
        camera = {eye + Vec3d(kShift), target + Vec3d(kShift), {0, 0, 1}, fovy_deg};
    }
    View view(const Lattice& lattice = {}) const { return View(camera, size, lattice); }
};

void colourVertices(Mesh& mesh) {
    mesh.colour.resize(mesh.vertexCount());
    for (size_t i = 0; i < mesh.vertexCount(); ++i)
        mesh.colour[i] = {uint8_t(i / 7), uint8_t(i / 3), uint8_t(255 - i / 5), 255};
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

/// Large triangles alone.
Scene coarseScene() {
    Scene scene;
    scene.add(sphere({600, 500, 400}, 350, 7, 5));
    scene.add(grid(2, 2, [](double u, double v) {
        return Vec3d(3000 * u - 1000, 3000 * v - 1000, 300 + 100 * u);
    }));
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
    std::vector<GlItem> items;
    for (uint32_t i = 0; i < scene.patches.size(); ++i) {
        const DrawPatch& p = scene.patches[i];
        EXPECT_TRUE(renderer.upload({0, i}, {p.mesh, 1}));
        items.push_back({{0, i}, 0, p.one_sided, p.id, p.tint, p.value});
    }
    renderer.begin(scene.view(), Lattice{}, settings);
    renderer.draw(items);
    for (uint32_t i = 0; i < scene.patches.size(); ++i) renderer.release({0, i});
    return renderer.readPicture();
}

bool covered(const Picture& picture, int x, int y) {
    return std::isfinite(picture.depth[picture.index(x, y)]);
}

/// The pixel or one of the eight around it is another's in coverage.
bool atSilhouette(const Picture& picture, int x, int y) {
    for (int v = std::max(y - 1, 0); v <= std::min(y + 1, picture.size.height - 1); ++v)
        for (int u = std::max(x - 1, 0); u <= std::min(x + 1, picture.size.width - 1); ++u)
            if (covered(picture, u, v) != covered(picture, x, y)) return true;
    return false;
}

struct Difference {
    size_t coverage = 0;         ///< pixels in one and not in the other
    size_t off_silhouettes = 0;  ///< those not within a pixel of one
    size_t shade = 0;            ///< pixels that differ by more than 2 of 255
    size_t depth = 0;            ///< pixels whose depths differ by more than 1e-4
    size_t pixels = 0;
};

Difference compare(const Picture& cpu, const Picture& gpu) {
    Difference d;
    d.pixels = cpu.pixelCount();
    for (int y = 0; y < cpu.size.height; ++y)
        for (int x = 0; x < cpu.size.width; ++x) {
            const size_t i = cpu.index(x, y);
            if (covered(cpu, x, y) != covered(gpu, x, y)) {
                ++d.coverage;
                d.off_silhouettes += !atSilhouette(cpu, x, y);
                continue;
            }
            const Rgba8 &a = cpu.colour[i], &b = gpu.colour[i];
            d.shade += std::abs(a.r - b.r) > 2 || std::abs(a.g - b.g) > 2 ||
                       std::abs(a.b - b.b) > 2 || a.a != b.a;
            if (covered(cpu, x, y))
                d.depth += std::abs(cpu.depth[i] - gpu.depth[i]) > 1e-4f * cpu.depth[i];
        }
    return d;
}

void expectAlike(const Picture& cpu, const Picture& gpu, const std::string& what) {
    ASSERT_EQ(gpu.colour.size(), cpu.colour.size());
    EXPECT_EQ(gpu.focal_px, cpu.focal_px);
    const Difference d = compare(cpu, gpu);
    if (getenv("PIETRA_GL_PRINT"))
        printf("%s: coverage %zu off %zu shade %zu (%.3f %%) depth %zu of %zu\n", what.c_str(),
               d.coverage, d.off_silhouettes, d.shade, 100.0 * d.shade / d.pixels, d.depth,
               d.pixels);
    EXPECT_LE(double(d.coverage), 1e-4 * double(d.pixels)) << what;
    EXPECT_EQ(d.off_silhouettes, 0u) << what;
    EXPECT_LE(double(d.shade), 5e-3 * double(d.pixels)) << what;
    EXPECT_LE(double(d.depth), 1e-3 * double(d.pixels)) << what;
}

using GlRendererTest = GlTest;

TEST_F(GlRendererTest, DrawsWhatTheCpuDraws) {
    const Scene scene = variedScene();
    for (const int samples : {1, 4}) {
        GlRenderer renderer(scene.size, samples, kVram);
        for (const Show show :
             {Show::kShaded, Show::kNormals, Show::kDepth, Show::kLod, Show::kPatches,
              Show::kTriangles, Show::kError, Show::kColour, Show::kScalar})
            for (const bool two_sided : {false, true}) {
                ShadeSettings settings;
                settings.show = show;
                settings.two_sided = two_sided;
                settings.scalar_count = 2;
                settings.scalar_index = 1;
                settings.scalar_min = 20;
                settings.scalar_max = 250;
                settings.value_max = 4;
                expectAlike(drawOnCpu(scene, samples, settings),
                            drawOnGpu(renderer, scene, settings),
                            "show " + std::to_string(int(show)) + ", " + std::to_string(samples) +
                                " samples" + (two_sided ? ", two-sided" : ""));
            }
    }
}

}  // namespace
}  // namespace pietra
namespace pietra { namespace {
TEST_F(GlRendererTest, Debug) {
    const Scene scene = variedScene();
    for (int two = 0; two < 2; ++two) for (const int samples : {1, 4}) {
        GlRenderer renderer(scene.size, samples, kVram);
        ShadeSettings settings; settings.show = Show::kDepth; settings.two_sided = two;
        Picture c = drawOnCpu(scene, samples, settings), g = drawOnGpu(renderer, scene, settings);
        float mn[2]={1e30f,1e30f}, mx[2]={0,0}; double worst=0; size_t hist[10]={}; 
        for (size_t i=0;i<c.depth.size();++i) { for (int k=0;k<2;++k){ float d=(k?g:c).depth[i]; if(std::isfinite(d)){mn[k]=std::min(mn[k],d);mx[k]=std::max(mx[k],d);} }
            if (std::isfinite(c.depth[i])&&std::isfinite(g.depth[i])) { double e=std::abs(c.depth[i]-g.depth[i])/c.depth[i]; worst=std::max(worst,e); int h=e>0?std::min(9,std::max(0,int(-std::log10(e)))):9; hist[h]++; if (e>1e-4&&i%3001==0) printf("  px %zu,%zu %g %g\n", i%320,i/320,c.depth[i],g.depth[i]);} }
        printf("two %d samples %d cpu %g..%g gpu %g..%g worst %g hist:", two,samples,mn[0],mx[0],mn[1],mx[1],worst); for(auto h:hist)printf(" %zu",h); puts("");
        for (int i=0;i<5;++i){size_t p=c.index(40*i+20,200); printf(" %d/%d",c.colour[p].r,g.colour[p].r);} puts("");
    }
}
}}
