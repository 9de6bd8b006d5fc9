#include "render/offline/offline_picture.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <mutex>

#include "base/check.h"
#include "base/error.h"
#include "base/stopwatch.h"
#include "base/text.h"
#include "render/offline/batch_drawer.h"
#include "runtime/eye_side.h"
#include "runtime/live_settle.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

/// Larger batches draw no faster.
constexpr size_t kLargestBatch = size_t(256) << 20, kLargestGlBatch = size_t(64) << 20;
/// What the renderers keep of a pixel with one sample and with four (rasteriser.h, gl/renderer.h),
/// and a pixel of the picture that is handed out.
constexpr size_t kRasterPixelBytes[2] = {17, 49}, kGlPixelBytes[2] = {16, 40};
constexpr size_t kPictureBytes = sizeof(Rgba8) + sizeof(float);
/// Threads with their stacks and heaps, and what else nobody counts.
constexpr size_t kUncountedBytes = size_t(3) << 20;

/// A model in the scene, with what is drawn of it.
struct SceneModel {
    const ModelReader* reader;
    View view;
    Cut cut;

    const Node& node(NodeIndex i) const { return reader->nodes()[i]; }
    double pixelsOf(NodeIndex i) const { return view.pixelsOf(node(i)); }
};

/// The mesh's triangles that the column holds. False if there are none.
bool keepHeld(Mesh& mesh, const LiveColumn& column) {
    size_t kept = 0;
    for (size_t t = 0; t < mesh.triangleCount(); ++t) {
        const auto& [a, b, c] = mesh.triangle[t];
        if (!column.holds(mesh.position[a], mesh.position[b], mesh.position[c])) continue;
        mesh.triangle[kept] = mesh.triangle[t];
        if (!mesh.edge_class.empty()) mesh.edge_class[kept] = mesh.edge_class[t];
        ++kept;
    }
    mesh.triangle.resize(kept);
    if (!mesh.edge_class.empty()) mesh.edge_class.resize(kept);
    return kept > 0;
}

class OfflineRenderer {
public:
    OfflineRenderer(std::span<const ModelReader* const> models, const Camera& camera,
                    const PictureSize& size, const OfflineSettings& settings, Progress& progress)
        : settings_(settings), size_(size), progress_(progress) {
        for (const ModelReader* model : models)
            models_.push_back(
                {model, View(camera, size, model->info().lattice, settings.select), {}});
    }

    OfflinePicture run() {
        const Stopwatch watch;
        uint64_t patches = 0;
        for (const SceneModel& model : models_)
            settings_.shade.two_sided =
                settings_.shade.two_sided || eyeMayBeInside(*model.reader, model.view);
        settings_.culling.cone &= !settings_.shade.two_sided;
        for (SceneModel& model : models_) {
            select(model);
            patches += model.cut.nodes.size();
        }
        setValueRange();
        result_.statistics.select_ms = watch.ms();
        planMemory();
        progress_.beginStage("draw", patches);
        const auto make = onGpu() ? makeGlDrawer : makeRasterDrawer;
        const auto drawer =
            make(models_[0].view, models_[0].reader->info().lattice,
                 {settings_.samples, settings_.shade, settings_.culling.occlusion, batch_bytes_});
        result_.statistics.tolerance_px = settings_.pixels;
        for (uint32_t m = 0; m < models_.size(); ++m)
            models_[m].reader->hasPatches() ? drawModel(m, *drawer) : drawLive(m, *drawer);
        result_.picture = drawer->finish();
        progress_.endStage();
        report(drawer->statistics());
        result_.statistics.total_ms = watch.ms();
        return std::move(result_);
    }

private:
    void select(SceneModel& model) const {
        if (!model.reader->hasPatches()) return;
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
                if (const double error = model.pixelsOf(node); std::isfinite(error))
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
        const size_t pixel = (onGpu() ? kGlPixelBytes : kRasterPixelBytes)[settings_.samples == 4];
        fixed_bytes_ = tables +
                       size_t(size_.width) * size_t(size_.height) * (pixel + kPictureBytes) +
                       (in_flight() + size_t(settings_.jobs)) * page + kUncountedBytes;
        // Each thread's decoder has scratch of a page's size. The page that fills a batch may
        // exceed it; with screen vertices it is twice as large. Graphics memory must hold a page.
        const size_t batch = onGpu() ? leastGlBatchBytes(page) : 2 * page;
        const size_t least = fixed_bytes_ + batch;
        if (least > settings_.memory_bytes)
            throw MemoryError(fmt::format("drawing this needs {} at least", formatBytes(least)));
        size_t spare = settings_.memory_bytes - least;
        const auto is_live = [](const SceneModel& model) { return !model.reader->hasPatches(); };
        if (std::any_of(models_.begin(), models_.end(), is_live))
            spare -= live_bytes_ = spare / 4 * 3;
        batch_bytes_ = onGpu() ? std::min(batch + spare, std::max(batch, kLargestGlBatch))
                               : std::min(spare, kLargestBatch);
        result_.statistics.resident_bytes = fixed_bytes_;
    }

    bool onGpu() const { return settings_.renderer == DrawWith::kGl; }
    size_t in_flight() const { return size_t(settings_.jobs) + 1; }

    void drawModel(uint32_t m, BatchDrawer& drawer) {
        const SceneModel& model = models_[m];
        drawer.setModel(model.view, model.reader->info().lattice);
        const ReadTimes times =
            visitInOrder(*model.reader, model.cut.nodes, in_flight(), [&](DecodedRun& run) {
                std::vector<DrawPatch> list;
                for (size_t i = 0; i < run.nodes.size(); ++i)
                    list.push_back(describe(m, run.nodes[i], run.patches[i]));
                drawer.add(std::move(run.patches), std::move(list));
                progress_.tick(run.nodes.size());
            });
        result_.statistics.load_ms += times.load_ms;
        result_.statistics.decode_ms += times.decode_ms;
    }

    void drawLive(uint32_t m, BatchDrawer& drawer) {
        const SceneModel& model = models_[m];
        drawer.setModel(model.view, model.reader->info().lattice);
        const Stopwatch watch;
        const std::unique_ptr<LiveModel> live = openLive(*model.reader, settings_.open_live);
        double& tolerance = result_.statistics.tolerance_px;
        if (settings_.pixels > 0) {
            tolerance = std::max(
                tolerance, settle(*model.reader, *live, model.view, settings_.pixels, live_bytes_));
            addChunks(m, *live, nullptr, drawer);
        } else {
            visitColumns(*model.reader, *live, model.view, live_bytes_,
                         [&](const LiveColumn& column) { addChunks(m, *live, &column, drawer); });
        }
        result_.statistics.load_ms += watch.ms();
    }

    /// Those of a column have just the triangles that it holds.
    void addChunks(uint32_t m, const LiveModel& live, const LiveColumn* column,
                   BatchDrawer& drawer) {
        const SceneModel& model = models_[m];
        if (!live.faults().empty())
            throw InputError(model.reader->path(), "", live.faults().front());
        OfflineStatistics& statistics = result_.statistics;
        statistics.resident_bytes =
            std::max(statistics.resident_bytes, fixed_bytes_ + live.bytes());
        std::vector<DrawPatch> list;
        listChunks(live, m, model.view, settings_.culling, eyeMayBeInside(live, model.view),
                   settings_.shade.show == Show::kError, list);
        for (DrawPatch& patch : list) {
            std::vector<Mesh> mesh{*patch.mesh};
            if (column != nullptr && !keepHeld(mesh[0], *column)) continue;
            patch.mesh = mesh.data();
            drawer.add(std::move(mesh), {patch});
        }
    }

    DrawPatch describe(uint32_t m, NodeIndex index, const Mesh& mesh) const {
        const SceneModel& model = models_[m];
        DrawPatch patch;
        patch.mesh = &mesh;
        patch.one_sided = model.node(index).closed;
        patch.id = index + m * 0x9e3779b9u;  // far from the numbers of other models' nodes
        patch.value = settings_.shade.show == Show::kError ? float(model.pixelsOf(index))
                                                           : float(model.node(index).level);
        return patch;
    }

    void report(const DrawerStatistics& drawn) {
        OfflineStatistics& statistics = result_.statistics;
        statistics.patches = drawn.patches;
        statistics.triangles = drawn.triangles;
        statistics.pixels_covered = drawn.pixels_covered;
        statistics.draw_ms = drawn.draw_ms;
        statistics.device_bytes = drawn.device_bytes;
        statistics.resident_bytes += std::max(drawn.held_bytes, drawn.device_bytes);
    }

    OfflineSettings settings_;
    const PictureSize size_;
    Progress& progress_;
    std::vector<SceneModel> models_;
    size_t fixed_bytes_ = 0, batch_bytes_ = 0, live_bytes_ = 0;
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
        if (!model->hasPatches()) continue;
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
