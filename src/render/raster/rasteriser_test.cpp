#include "render/raster/rasteriser.h"

#include <gtest/gtest.h>

#include <limits>
#include <random>

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

}  // namespace
}  // namespace pietra
