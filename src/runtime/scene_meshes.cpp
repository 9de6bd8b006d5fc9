#include "runtime/scene_meshes.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "base/text.h"
#include "runtime/live_settle.h"

namespace pietra {
namespace {

/// A tolerance, in pixels, at which everything is as coarse as can be, but for what the eye is so
/// near to that it may show at any.
constexpr double kCoarse = 1e9;
/// At which nothing shows, wherever the eye is: errors times this underflow.
constexpr double kCoarsest = 1e36;

}  // namespace

SceneMeshes::SceneMeshes(const std::vector<const ModelReader*>& readers,
                         const SceneSettings& settings, uint32_t first_model)
    : pool_(readers, settings.open_live, settings.loader_threads),
      uploads_(settings.sink, first_model),
      first_model_(first_model),
      adapt_ms_(settings.adapt_ms) {}

void SceneMeshes::uploadRoots(size_t capacity_bytes) {
    for (uint32_t i = 0; i < pool_.size(); ++i)
        if (!uploads_.update(i, pool_.model(i).chunks()))
            throw MemoryError(
                fmt::format("the coarsest level needs more than {} of graphics memory",
                            formatBytes(capacity_bytes)));
}

double SceneMeshes::adapt(uint32_t i, const FrameRequest& request, double pixels, PagePool& pages,
                          ModelFrame& out) {
    const auto adaptNow = [&](const LiveTask& task) -> const LiveFrame& {
        pages.setElsewhere(pool_.bytes());
        return pool_.adapt(i, task, pages.freeRam());
    };
    if (i == 0) {
        may_upload_ = uploads_.beginFrame();
        uploads_fit_ = true;
    }
    LiveTask task{.view = &out.view,
                  .seen = request.seen,
                  .pixels = pixels,
                  .milliseconds = adapt_ms_ / double(pool_.size()),
                  .only_look = !may_upload_,
                  .most_triangles = uploads_.mostTriangles(i)};
    const LiveFrame& live = adaptNow(task);
    // No frame has a hole, if it takes time.
    while (!uploads_.update(i, pool_.model(i).chunks()) && task.pixels < kCoarsest) {
        uploads_fit_ = false;
        task.pixels = task.pixels < kCoarse ? 4 * std::max(task.pixels, 1.0) : kCoarsest;
        task.milliseconds = std::numeric_limits<double>::infinity();
        task.only_look = false;
        (void)adaptNow(task);
    }
    out.two_sided = eyeMayBeInside(pool_.model(i), out.view);
    listChunks(pool_.model(i), first_model_ + i, out.view, request.culling, out.two_sided,
               request.show_error, out.patches);
    return live.largest_px;
}

}  // namespace pietra
