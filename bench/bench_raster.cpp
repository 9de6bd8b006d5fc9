// Draws a million micro-triangles that fill 1280x1024, in patches of some 4000, with the CPU
// rasteriser and, where there is OpenGL 4.5, with GlRenderer, on whatever driver there is, in turn
// in one process; prints the median times and their ratio at 1 and 4 samples a pixel.
//
//   bench_raster [ROUNDS] [TRIANGLES] [SAMPLES] [--alone]

#include <epoxy/gl.h>
#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <ctime>
#include <deque>
#include <optional>
#include <vector>

#include "base/error.h"
#include "clock.h"
#include "gpu/context.h"
#include "render/gl/renderer.h"
#include "render/raster/rasteriser.h"
#include "render/raster/test_meshes.h"

using namespace pietra;

namespace {

constexpr PictureSize kSize{1280, 1024};

struct Scene {
    std::deque<Mesh> meshes;
    std::vector<DrawPatch> patches;
    size_t triangles = 0;
    Camera camera;
};

/// A gentle relief that just overfills the picture, as square patches.
Scene makeScene(size_t triangles) {
    Scene scene;
    const double height = double(1 << 19), width = height * kSize.width / kSize.height;
    const int rows = int(std::sqrt(double(triangles) / 2 * height / width));
    const int columns = int(double(triangles) / 2 / rows);
    constexpr int kBlock = 45;
    for (int y = 0; y < rows; y += kBlock)
        for (int x = 0; x < columns; x += kBlock) {
            const int w = std::min(kBlock, columns - x), h = std::min(kBlock, rows - y);
            scene.meshes.push_back(test_meshes::grid(w, h, [&](double u, double v) {
                const double s = (x + u * w) / columns, t = (y + v * h) / rows;
                const double relief =
                    std::sin(40 * s) * std::cos(33 * t) + 0.3 * std::sin(211 * s + 170 * t);
                return Vec3d(s * width, t * height, 20000 + 1500 * relief);
            }));
        }
    for (const Mesh& mesh : scene.meshes) {
        scene.patches.push_back({&mesh, false, uint32_t(scene.patches.size()), {}, 0});
        scene.triangles += mesh.triangleCount();
    }
    const Vec3d centre(width / 2, height / 2, 20000);
    const double distance = height / 2 / std::tan(15 * std::numbers::pi / 180) * 0.995;
    scene.camera = {centre + Vec3d(0, 0, distance), centre, {0, 1, 0}, 30};
    return scene;
}

/// Wall clock, and processor time of all threads together, which a busy machine disturbs less.
struct Cost {
    double wall_ms, cpu_ms;
};

template <class Body>
Cost costOf(const Body& body) {
    const double wall = wallSeconds(), cpu = processSeconds();
    body();
    return {wallSeconds() - wall, processSeconds() - cpu};
}

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

template <class T>
double medianOf(const std::vector<T>& costs, double T::*member) {
    std::vector<double> values;
    for (const T& c : costs) values.push_back(c.*member);
    return median(values);
}

void report(const char* name, const std::vector<Cost>& costs, size_t triangles) {
    const double wall = medianOf(costs, &Cost::wall_ms), cpu = medianOf(costs, &Cost::cpu_ms);
    double best_wall = wall, best_cpu = cpu;
    for (const Cost& c : costs) {
        best_wall = std::min(best_wall, c.wall_ms);
        best_cpu = std::min(best_cpu, c.cpu_ms);
    }
    fmt::print(
        "  {:8}  wall: median {:6.2f}, best {:6.2f} ms, {:5.1f} M triangles/s;  "
        "cpu: median {:6.2f}, best {:6.2f} ms\n",
        name, wall, best_wall, double(triangles) / wall / 1e3, cpu, best_cpu);
}

/// The same scene in graphics memory.
class Rival {
public:
    Rival(const Scene& scene, const View& view, int samples)
        : view_(view), renderer_(kSize, samples, size_t(256) << 20) {
        for (uint32_t i = 0; i < scene.patches.size(); ++i) {
            renderer_.upload({0, i}, {scene.patches[i].mesh, 1});
            items_.push_back(scene.patches[i]);
            items_.back().page = {0, i};
        }
    }
    /// Waits until all is done; nothing is read back.
    void draw() {
        renderer_.begin(view_, Lattice{}, {});
        renderer_.draw(items_);
        renderer_.finish();
        glFinish();
    }
    size_t pixelsCovered() {
        size_t covered = 0;
        for (const float depth : renderer_.readPicture().depth) covered += std::isfinite(depth);
        return covered;
    }

private:
    const View& view_;
    GlRenderer renderer_;
    std::vector<DrawPatch> items_;
};

void measure(const Scene& scene, int samples, int rounds, const GlContext* context) {
    const Lattice lattice;
    const View view(scene.camera, kSize, lattice);
    Rasteriser rasteriser(view, lattice, samples, {});
    std::vector<Cost> ours, theirs;
    std::vector<RasterStatistics> stages;
    const auto draw = [&] {
        rasteriser.restart(view, lattice, {});
        rasteriser.draw(scene.patches);
        rasteriser.finish();
    };
    draw();
    fmt::print("{} sample(s), {} triangles, {} patches, {} pixels covered\n", samples,
               scene.triangles, scene.patches.size(), rasteriser.statistics().pixels_covered);
    std::optional<Rival> rival;
    if (context != nullptr) {
        rival.emplace(scene, view, samples);
        rival->draw();
        fmt::print("  rival: {}, {} pixels covered\n", context->renderer(), rival->pixelsCovered());
    }
    for (int i = 0; i < rounds; ++i) {
        ours.push_back(costOf(draw));
        stages.push_back(rasteriser.statistics());
        if (rival) theirs.push_back(costOf([&] { rival->draw(); }));
    }
    report("pietra", ours, scene.triangles);
    const auto stage = [&](double RasterStatistics::*member) { return medianOf(stages, member); };
    fmt::print("            transform {:.2f}, raster {:.2f}, shade {:.2f}, finish {:.2f} ms\n",
               stage(&RasterStatistics::transform_ms), stage(&RasterStatistics::raster_ms),
               stage(&RasterStatistics::shade_ms), stage(&RasterStatistics::finish_ms));
    if (theirs.empty()) return;
    report("opengl", theirs, scene.triangles);
    fmt::print("  ratio of medians: wall {:.2f}, cpu {:.2f}\n",
               medianOf(theirs, &Cost::wall_ms) / medianOf(ours, &Cost::wall_ms),
               medianOf(theirs, &Cost::cpu_ms) / medianOf(ours, &Cost::cpu_ms));
}

}  // namespace

int main(int argc, char** argv) {
    bool alone = false;
    std::vector<long> numbers;
    for (int i = 1; i < argc; ++i)
        if (std::strcmp(argv[i], "--alone") == 0)
            alone = true;
        else
            numbers.push_back(std::strtol(argv[i], nullptr, 10));
    const int rounds = numbers.empty() ? 15 : int(numbers[0]);
    const Scene scene = makeScene(numbers.size() > 1 ? size_t(numbers[1]) : 1000000);
    std::optional<GlContext> context;
    try {
        if (!alone) context.emplace(GlContext::headless());
    } catch (const UsageError& error) {
        fmt::print("{}\n", error.what());
    }
    for (const int samples : {1, 4})
        if (numbers.size() <= 2 || numbers[2] == samples)
            measure(scene, samples, std::max(rounds, 1), context ? &*context : nullptr);
}
