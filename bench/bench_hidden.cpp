// Flies a path through models with the CPU rasteriser, all that a frame needs being loaded, and
// draws each frame whole and without what is hidden, in turn; prints medians and their ratio.
//
//   bench_hidden PATH FRAMES SAMPLES MODEL...

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

#include "base/stopwatch.h"
#include "render/raster/rasteriser.h"
#include "runtime/scene.h"
#include "runtime/standard_paths.h"

using namespace pietra;

namespace {

constexpr PictureSize kSize{1280, 1024};

double median(std::vector<double> values) {
    std::nth_element(values.begin(), values.begin() + values.size() / 2, values.end());
    return values[values.size() / 2];
}

struct Way {
    Rasteriser rasteriser;
    bool leave_out_hidden;
    std::vector<double> ms{}, triangles{}, transform{}, raster{}, shade{}, finish{};

    void draw(const std::vector<ModelPatches>& models) {
        const Stopwatch watch;
        rasteriser.restart(models[0].view, *models[0].lattice, {});
        rasteriser.drawAll(models, leave_out_hidden);
        ms.push_back(watch.ms());
        const RasterStatistics& s = rasteriser.statistics();
        triangles.push_back(double(s.triangles - s.triangles_hidden));
        transform.push_back(s.transform_ms);
        raster.push_back(s.raster_ms);
        shade.push_back(s.shade_ms);
        finish.push_back(s.finish_ms);
    }
};

}  // namespace

int main(int argc, char** argv) {
    if (argc < 5 || !parseStandardPath(argv[1])) return 2;
    const int frames = std::atoi(argv[2]), samples = std::atoi(argv[3]);
    std::vector<std::unique_ptr<ModelReader>> readers;
    std::vector<const ModelReader*> models;
    for (int i = 4; i < argc; ++i)
        models.push_back(readers.emplace_back(std::make_unique<ModelReader>(argv[i])).get());
    const CameraPath path = standardPath(*parseStandardPath(argv[1]),
                                         coarseSurface(models, nullptr), UpAxis::kZ, kSize);
    Scene scene(models, {size_t(2) << 30, 1});
    const View any({}, kSize, {});
    Way way[2] = {{Rasteriser(any, {}, samples, {}), false},
                  {Rasteriser(any, {}, samples, {}), true}};
    for (int i = 0; i < frames; ++i) {
        FrameRequest request;
        request.camera = path.frame(i, frames);
        request.size = kSize;
        request.prefetch = false;
        std::vector<ModelPatches> list;
        const Frame& frame = scene.converge(request);
        for (size_t m = 0; m < models.size(); ++m)
            list.push_back(
                {frame.models[m].view, &models[m]->info().lattice, frame.models[m].patches});
        for (int k = 0; k < 2; ++k) way[(i + k) % 2].draw(list);
        if (way[0].rasteriser.finish().colour != way[1].rasteriser.finish().colour) return 1;
    }
    for (const Way& w : way)
        fmt::print(
            "{}: {:.1f} ms, {:.0f} triangles: transform {:.2f}, raster {:.2f}, shade {:.2f}, "
            "finish {:.2f} ms\n",
            w.leave_out_hidden ? "without hidden ones" : "all", median(w.ms), median(w.triangles),
            median(w.transform), median(w.raster), median(w.shade), median(w.finish));
    fmt::print("ratio {:.2f}\n", median(way[0].ms) / median(way[1].ms));
}
