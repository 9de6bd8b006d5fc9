#include "render/offline/offline_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <mutex>

#include "base/check.h"
#include "base/error.h"
#include "base/text.h"
#include "render/raster/rasteriser.h"
#include "runtime/eye_side.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

using Clock = std::chrono::steady_clock;

/// Larger batches draw no faster.
constexpr size_t kLargestBatch = size_t(256) << 20;
/// What the rasteriser keeps of a vertex and of a pixel (rasteriser.h), and a pixel of the picture
/// that is handed out.
constexpr size_t kScreenVertexBytes = 16;
constexpr size_t kPixelBytes = 17, kPixelBytesOfFour = 49;
constexpr size_t kPictureBytes = sizeof(Rgba8) + sizeof(float);
/// Threads with their stacks and heaps, and what else nobody counts.
constexpr size_t kUncountedBytes = size_t(3) << 20;

double msSince(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// A model in the scene, with what is drawn of it.
struct SceneModel {
    const ModelReader* reader;
    View view;
    Cut cut;

    const Node& node(NodeIndex i) const { return reader->nodes()[i]; }
    double errorInPixels(NodeIndex i) const {
        return view.errorInPixels(node(i).error, node(i).saturated);
    }
};

/// Of a mesh while it is drawn.
size_t drawnBytes(const Mesh& mesh) {
    const auto bytes = [](const auto& array) { return array.size() * sizeof(array[0]); };
    return bytes(mesh.position) + bytes(mesh.triangle) + bytes(mesh.edge_class) +
           bytes(mesh.normal) + bytes(mesh.colour) + bytes(mesh.scalar) +
           mesh.vertexCount() * kScreenVertexBytes;
}

class OfflineRenderer {
public:
    OfflineRenderer(std::span<const ModelReader* const> models, const Camera& camera,
                    const PictureSize& size, const OfflineSettings& settings, Progress& progress)
        : settings_(settings), size_(size), progress_(progress) {
        for (const ModelReader* model : models)
            models_.push_back({model, View(camera, size, model->info().lattice), {}});
    }

    OfflinePicture run() {
        const auto start = Clock::now();
        uint64_t patches = 0;
        for (const SceneModel& model : models_)
            settings_.shade.two_sided |= eyeMayBeInside(*model.reader, model.view);
        settings_.culling.cone &= !settings_.shade.two_sided;
        for (SceneModel& model : models_) {
            select(model);
            patches += model.cut.nodes.size();
        }
        setValueRange();
        result_.statistics.select_ms = msSince(start);
        planMemory();
        progress_.beginStage("draw", patches);
        Rasteriser rasteriser(models_[0].view, models_[0].reader->info().lattice, settings_.samples,
                              settings_.shade);
        for (uint32_t m = 0; m < models_.size(); ++m) drawModel(m, rasteriser);
        result_.picture = rasteriser.finish();
        progress_.endStage();
        report(rasteriser.statistics());
        result_.statistics.total_ms = msSince(start);
        return std::move(result_);
    }

private:
    void select(SceneModel& model) const {
        Culling culling = settings_.culling;
        double pixels = settings_.pixels;
        if (pixels == 0) {
            culling.contribution = false;
            pixels = -1;  // what states no error at all is refined, too
        }
        model.cut = visibleCut(model.reader->nodes(), model.view, pixels, culling);
    }

    void setValueRange() {
        if (settings_.shade.show != Show::kError) return;
        settings_.shade.value_min = 0;
        settings_.shade.value_max = float(settings_.pixels);
        if (settings_.pixels > 0) return;
        for (const SceneModel& model : models_)
            for (const NodeIndex node : model.cut.nodes)
                if (const double error = model.errorInPixels(node); std::isfinite(error))
                    settings_.shade.value_max = std::max(settings_.shade.value_max, float(error));
    }

    /// Sets what is held throughout, and what a batch may have beside it.
    void planMemory() {
        size_t page = 0, tables = 0;
        for (const SceneModel& model : models_) {
            page = std::max(page, largestDecodedPageBytes(*model.reader));
            tables += model.reader->nodes().size() * sizeof(Node) +
                      model.reader->pageCount() * sizeof(PageInfo);
        }
        const size_t pixel = settings_.samples == 4 ? kPixelBytesOfFour : kPixelBytes;
        fixed_bytes_ = tables +
                       size_t(size_.width) * size_t(size_.height) * (pixel + kPictureBytes) +
                       (in_flight() + size_t(settings_.jobs)) * page + kUncountedBytes;
        // Each thread's decoder has scratch of a page's size. The page that fills a batch may
        // exceed it; with screen vertices it is twice as large.
        const size_t least = fixed_bytes_ + 2 * page;
        if (least > settings_.memory_bytes)
            throw MemoryError(fmt::format("drawing this needs {} at least", formatBytes(least)));
        batch_bytes_ = std::min(settings_.memory_bytes - least, kLargestBatch);
        result_.statistics.resident_bytes = fixed_bytes_;
    }

    size_t in_flight() const { return size_t(settings_.jobs) + 1; }

    void drawModel(uint32_t m, Rasteriser& rasteriser) {
        const SceneModel& model = models_[m];
        rasteriser.setModel(model.view, model.reader->info().lattice);
        std::vector<DecodedRun> batch;
        size_t bytes = 0;
        const ReadTimes times =
            visitInOrder(*model.reader, model.cut.nodes, in_flight(), [&](DecodedRun& run) {
                for (const Mesh& mesh : run.patches) bytes += drawnBytes(mesh);
                batch.push_back(std::move(run));
                if (bytes < batch_bytes_) return;
                drawBatch(m, batch, bytes, rasteriser);
                batch.clear();
                bytes = 0;
            });
        drawBatch(m, batch, bytes, rasteriser);
        result_.statistics.load_ms += times.load_ms;
        result_.statistics.decode_ms += times.decode_ms;
    }

    void drawBatch(uint32_t m, const std::vector<DecodedRun>& batch, size_t bytes,
                   Rasteriser& rasteriser) {
        std::vector<DrawPatch> list;
        for (const DecodedRun& run : batch)
            for (size_t i = 0; i < run.nodes.size(); ++i)
                list.push_back(describe(m, run.nodes[i], run.patches[i]));
        rasteriser.draw(list);
        result_.statistics.resident_bytes =
            std::max(result_.statistics.resident_bytes, fixed_bytes_ + bytes);
        progress_.tick(list.size());
    }

    DrawPatch describe(uint32_t m, NodeIndex index, const Mesh& mesh) const {
        const SceneModel& model = models_[m];
        DrawPatch patch;
        patch.mesh = &mesh;
        patch.one_sided = model.node(index).closed;
        patch.id = index + m * 0x9e3779b9u;  // far from the numbers of other models' nodes
        patch.value = settings_.shade.show == Show::kError ? float(model.errorInPixels(index))
                                                           : float(model.node(index).level);
        return patch;
    }

    void report(const RasterStatistics& raster) {
        result_.statistics.patches = raster.patches;
        result_.statistics.triangles = raster.triangles;
        result_.statistics.pixels_covered = raster.pixels_covered;
        result_.statistics.draw_ms = raster.totalMs();
    }

    OfflineSettings settings_;
    const PictureSize size_;
    Progress& progress_;
    std::vector<SceneModel> models_;
    size_t fixed_bytes_ = 0, batch_bytes_ = 0;
    OfflinePicture result_;
};

}  // namespace

OfflinePicture drawModels(std::span<const ModelReader* const> models, const Camera& camera,
                          const PictureSize& size, const OfflineSettings& settings,
                          Progress& progress) {
    CHECK(!models.empty());
    return OfflineRenderer(models, camera, size, settings, progress).run();
}

std::pair<float, float> scalarRange(std::span<const ModelReader* const> models, int scalar) {
    float low = std::numeric_limits<float>::infinity(), high = -low;
    std::mutex mutex;
    for (const ModelReader* model : models) {
        const size_t stride = model->info().schema.scalars.size();
        visitPatches(*model, rootCut(model->nodes()).nodes, [&](NodeIndex, const Mesh& mesh) {
            const std::lock_guard lock(mutex);
            for (size_t i = size_t(scalar); i < mesh.scalar.size(); i += stride) {
                if (!std::isfinite(mesh.scalar[i])) continue;
                low = std::min(low, mesh.scalar[i]);
                high = std::max(high, mesh.scalar[i]);
            }
        });
    }
    return low <= high ? std::pair(low, high) : std::pair(0.0f, 1.0f);
}

}  // namespace pietra
