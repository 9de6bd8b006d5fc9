#include "runtime/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/parallel.h"
#include "base/progress.h"
#include "base/stopwatch.h"
#include "base/text.h"
#include "runtime/live_pool.h"
#include "runtime/live_settle.h"
#include "runtime/live_uploads.h"
#include "runtime/page_pool.h"
#include "runtime/scene_tolerance.h"

namespace pietra {
namespace {

/// How far ahead the camera is predicted, seconds, and the share of the tolerance that prefetching
/// goes to where it stands.
constexpr double kLookahead = 0.5, kNextLevel = 0.5;
constexpr uint32_t kPrefetchFrames = 4;
/// What patches let go of at a time for adapted meshes, and the other way round.
constexpr size_t kReleasedBytes = size_t(2) << 20;
/// A tolerance, in pixels, at which everything is as coarse as can be.
constexpr double kCoarsest = 1e9;

std::vector<const ModelReader*> thoseThat(const std::vector<const ModelReader*>& all,
                                          bool have_patches) {
    std::vector<const ModelReader*> some;
    for (const ModelReader* reader : all)
        if (reader->hasPatches() == have_patches) some.push_back(reader);
    return some;
}

}  // namespace

size_t tableBytes(const ModelReader& model) {
    constexpr size_t kBesideNode = 32;  // forest.h, residency.h, forest_refiner.h
    return model.nodes().size() * (sizeof(Node) + kBesideNode);
}

class Scene::Impl {
public:
    Impl(const std::vector<const ModelReader*>& readers, const SceneSettings& settings)
        : models_(makeModels(thoseThat(readers, true))),
          live_(thoseThat(readers, false), settings.open_live, settings.loader_threads),
          table_bytes_(tablesOf(readers)),
          pages_(models_, settings.ram_bytes, table_bytes_, settings.loader_threads, settings.sink),
          uploads_(settings.sink, uint32_t(models_.size())),
          adapt_ms_(settings.adapt_ms) {
        uint32_t patches = 0, live = 0;
        for (const ModelReader* reader : readers)
            parts_.push_back(reader->hasPatches() ? Part{reader, false, patches++}
                                                  : Part{reader, true, live++});
        if (pages_.ramBytes() + live_.bytes() > pages_.ramBudget())
            throw MemoryError(
                fmt::format("the tables and the coarsest level need {}",
                            formatBytes(table_bytes_ + pages_.ramBytes() + live_.bytes())));
        for (uint32_t i = 0; i < live_.size(); ++i)
            if (!uploads_.update(i, live_.model(i).chunks()))
                throw MemoryError(
                    fmt::format("the coarsest level needs more than {} of graphics memory",
                                formatBytes(settings.sink->capacityBytes())));
        last_.seconds = -std::numeric_limits<double>::infinity();
    }

    const Frame& update(const FrameRequest& request);
    const std::vector<std::string>& faults() {
        faults_ = pages_.faults();
        faults_.insert(faults_.end(), live_.faults().begin(), live_.faults().end());
        return faults_;
    }

private:
    /// A model of the scene: one of models_, or of live_.
    struct Part {
        const ModelReader* reader;
        bool is_live;
        uint32_t index;
    };
    struct Missing {
        PageKey key;
        float pixels;
    };

    static SceneModels makeModels(const std::vector<const ModelReader*>& readers);
    static size_t tablesOf(const std::vector<const ModelReader*>& readers);
    void select(const FrameRequest& request);
    void select(uint32_t m, const FrameRequest& request, ModelFrame& out);
    void adapt(uint32_t i, const FrameRequest& request, ModelFrame& out);
    bool isBlocked();
    double usedShare() const;
    void wantMissing();
    void prefetch(const FrameRequest& request);
    Camera cameraAhead(const FrameRequest& request) const;
    std::vector<PageKey> pagesFor(const Camera& camera, const FrameRequest& request, double share);
    bool mayBeInside(uint32_t m, const View& view);
    void describe(const SceneModel& model, uint32_t m, bool show_error, ModelFrame& out) const;

    SceneModels models_;
    LivePool live_;
    const size_t table_bytes_;
    PagePool pages_;
    LiveUploads uploads_;
    bool uploads_fit_ = true, may_upload_ = true;
    std::vector<Part> parts_;
    const double adapt_ms_;
    std::vector<Missing> missing_;
    std::vector<PageKey> missing_for_eye_;
    std::vector<NodeIndex> cut_for_eye_;    // what tells where the eye is
    std::vector<PageIndex> pages_for_eye_;  // that hold it
    size_t used_bytes_ = 0;                 // of the pages that this frame needs and has
    SceneTolerance tolerance_;
    uint32_t frame_number_ = PageMemory::kFramesKept;
    FrameRequest last_;
    Frame frame_;
    std::vector<PageKey> ahead_, next_level_;  // to be prefetched
    std::vector<PageRequest> requests_;        // scratch
    std::vector<std::string> faults_;
};

size_t Scene::Impl::tablesOf(const std::vector<const ModelReader*>& readers) {
    size_t bytes = 0;
    for (const ModelReader* reader : readers) bytes += tableBytes(*reader);
    return bytes;
}

SceneModels Scene::Impl::makeModels(const std::vector<const ModelReader*>& readers) {
    SceneModels models;
    for (const ModelReader* reader : readers)
        models.push_back(std::make_unique<SceneModel>(*reader));
    return models;
}

const Frame& Scene::Impl::update(const FrameRequest& request) {
    const Stopwatch watch;
    pages_.publish(++frame_number_);
    live_.publish();
    frame_.publish_ms = watch.ms();
    select(request);
    wantMissing();
    // What others let go of is for what is needed, then.
    const bool is_short = pages_.blocked() || live_.shortOfMemory();
    request.prefetch && !is_short ? prefetch(request) : live_.forgetPrefetch();
    pages_.setElsewhere(live_.bytes(), live_.lackingBytes());
    pages_.load();
    live_.load(pages_.freeRam());
    const size_t missing = pages_.missing() + live_.missing();
    frame_.raised = tolerance_.factor() > 1;
    frame_.converged = missing == 0 && !frame_.raised;
    tolerance_.adapt({.same_request = last_.sameView(request),
                      .blocked = isBlocked(),
                      .missing = missing,
                      .used_share = usedShare()});
    frame_.settled = tolerance_.settled();
    last_ = request;
    frame_.resident_bytes = pages_.ramBytes() + live_.bytes() + table_bytes_;
    frame_.device_bytes = pages_.deviceBytes();
    frame_.bytes_read = pages_.bytesRead() + live_.bytesRead();
    frame_.select_ms = watch.ms() - frame_.publish_ms;
    return frame_;
}

/// Something needed does not fit, and nobody has anything that is not needed.
bool Scene::Impl::isBlocked() {
    if (pages_.blocked()) return !pages_.blockedInRam() || live_.release(kReleasedBytes) == 0;
    if ((live_.shortOfTriangles() || !uploads_fit_) && pages_.releaseDevice(kReleasedBytes) == 0)
        return true;
    return live_.shortOfMemory() &&
           live_.release(kReleasedBytes) + pages_.release(kReleasedBytes) == 0;
}

/// Of the memory of which this frame uses the larger part.
double Scene::Impl::usedShare() const {
    const bool has_sink = pages_.deviceBudget() > 0;
    const size_t in_ram = live_.neededBytes() + (has_sink ? 0 : used_bytes_);
    const double ram = double(in_ram) / double(pages_.ramBudget());
    if (!has_sink) return ram;
    // Meshes that are adapted do not use all of a sink.
    const double device = double(used_bytes_) + double(uploads_.bytes()) / LiveUploads::kUsable;
    return std::max(ram, device / double(pages_.deviceBudget()));
}

void Scene::Impl::select(const FrameRequest& request) {
    missing_.clear();
    missing_for_eye_.clear();
    frame_.tolerance_px = request.pixels;
    frame_.triangles = frame_.patch_count = used_bytes_ = 0;
    frame_.adapt_ms = 0;
    for (uint32_t i = 0; i < parts_.size(); ++i) {
        const View view(request.camera, request.size, parts_[i].reader->info().lattice);
        if (frame_.models.size() <= i) frame_.models.emplace_back(view);
        ModelFrame& out = frame_.models[i];
        out.view = view;
        parts_[i].is_live ? adapt(parts_[i].index, request, out)
                          : select(parts_[i].index, request, out);
        frame_.patch_count += out.patches.size();
    }
    frame_.operations = live_.operations();
}

void Scene::Impl::select(uint32_t m, const FrameRequest& request, ModelFrame& out) {
    SceneModel& model = *models_[m];
    out.two_sided = mayBeInside(m, out.view);
    Culling culling = request.culling;
    culling.cone &= !out.two_sided;
    model.refiner.select(out.view, request.pixels * tolerance_.factor(), culling, out.selection);
    for (PageIndex page = 0; page < model.last_used.size(); ++page) {
        if (model.refiner.used(page)) model.last_used[page] = frame_number_;
        if (model.residency.resident(page) && model.usedIn(frame_number_, page))
            used_bytes_ += model.drawn_bytes[page];
    }
    for (const PageRequest& r : out.selection.requests) missing_.push_back({{m, r.page}, r.pixels});
    describe(model, m, request.show_error, out);
    frame_.tolerance_px = std::max(frame_.tolerance_px, out.selection.largest_px);
    frame_.triangles += out.selection.triangles;
}

void Scene::Impl::adapt(uint32_t i, const FrameRequest& request, ModelFrame& out) {
    const Stopwatch watch;
    const auto adaptNow = [&](const LiveTask& task) -> const LiveFrame& {
        pages_.setElsewhere(live_.bytes());
        return live_.adapt(i, task, pages_.freeRam());
    };
    if (i == 0) may_upload_ = uploads_.beginFrame();
    LiveTask task{.view = &out.view,
                  .pixels = request.pixels * tolerance_.factor(),
                  .milliseconds = adapt_ms_ / double(live_.size()),
                  .only_look = !may_upload_,
                  .most_triangles = uploads_.mostTriangles(i)};
    const LiveFrame& live = adaptNow(task);
    if (i == 0) uploads_fit_ = true;
    // No frame has a hole, if it takes time.
    while (!uploads_.update(i, live_.model(i).chunks()) && task.pixels < kCoarsest) {
        uploads_fit_ = false;
        task.pixels = 4 * std::max(task.pixels, 1.0);
        task.milliseconds = std::numeric_limits<double>::infinity();
        task.only_look = false;
        (void)adaptNow(task);
    }
    frame_.adapt_ms += watch.ms();
    frame_.tolerance_px = std::max(frame_.tolerance_px, live.largest_px);
    const auto m = uint32_t(models_.size()) + i;
    listChunks(live_.model(i).chunks(), m, out.view, request.culling, request.show_error,
               out.patches);
    for (const DrawPatch& patch : out.patches) frame_.triangles += patch.mesh->triangleCount();
}

/// Of all models, largest error first.
void Scene::Impl::wantMissing() {
    std::stable_sort(missing_.begin(), missing_.end(),
                     [](const Missing& a, const Missing& b) { return a.pixels > b.pixels; });
    for (const Missing& page : missing_) pages_.want(page.key, Need::kDraw);
    for (const PageKey& key : missing_for_eye_) pages_.want(key, Need::kEye);
}

/// For where the camera will be in half a second, and for the next level where it is: these change
/// little from frame to frame, so that each is looked up anew in one frame of kPrefetchFrames.
void Scene::Impl::prefetch(const FrameRequest& request) {
    const uint32_t turn = frame_number_ % kPrefetchFrames;
    if (turn == 0) ahead_ = pagesFor(cameraAhead(request), request, 1);
    if (turn == kPrefetchFrames / 2) next_level_ = pagesFor(request.camera, request, kNextLevel);
    for (const Part& part : parts_) {
        const bool next_level = turn == kPrefetchFrames / 2;
        if (!part.is_live || (turn != 0 && !next_level)) continue;
        live_.prefetch(part.index,
                       View(next_level ? request.camera : cameraAhead(request), request.size,
                            part.reader->info().lattice),
                       request.pixels * tolerance_.factor() * (next_level ? kNextLevel : 1),
                       next_level);
    }
    for (const auto* pages : {&ahead_, &next_level_})
        for (const PageKey& key : *pages)
            if (!models_[key.model]->residency.resident(key.page)) pages_.want(key, Need::kLater);
}

Camera Scene::Impl::cameraAhead(const FrameRequest& request) const {
    const double dt = request.seconds - last_.seconds;
    Camera ahead = request.camera;
    if (dt > 0 && dt < kLookahead) {
        const double steps = kLookahead / dt;
        ahead.eye += (request.camera.eye - last_.camera.eye) * steps;
        ahead.target += (request.camera.target - last_.camera.target) * steps;
        if (ahead.eye == ahead.target) ahead = request.camera;
    }
    return ahead;
}

/// That a frame from there would lack, and this one does not.
std::vector<PageKey> Scene::Impl::pagesFor(const Camera& camera, const FrameRequest& request,
                                           double share) {
    std::vector<PageKey> pages;
    for (uint32_t m = 0; m < models_.size(); ++m) {
        SceneModel& model = *models_[m];
        requests_.clear();
        model.refiner.prefetch(View(camera, request.size, model.reader.info().lattice),
                               request.pixels * tolerance_.factor() * share, request.culling,
                               requests_);
        for (const PageRequest& r : requests_) pages.push_back({m, r.page});
    }
    return pages;
}

/// Whatever is not known counts as inside.
bool Scene::Impl::mayBeInside(uint32_t m, const View& view) {
    SceneModel& model = *models_[m];
    if (!holds(model.closed_parts, view.eye())) return false;
    // What is drawn is no coarser than what decided the matter, as long as that is all there.
    if (model.side && model.side->decides(view.eye()) &&
        std::all_of(model.side_pages.begin(), model.side_pages.end(),
                    [&](PageIndex page) { return model.residency.resident(page); })) {
        for (const PageIndex page : model.side_pages) model.eye_used[page] = frame_number_;
        return model.side->mayBeInside();
    }
    model.side.reset();
    cut_for_eye_.clear();
    pages_for_eye_.clear();
    requests_.clear();
    model.refiner.visitDrawable(
        view, kEyeSidePixels,
        [&](NodeIndex i) {
            cut_for_eye_.push_back(i);
            pages_for_eye_.push_back(model.forest.node(i).page);
        },
        requests_);
    for (const PageRequest& r : requests_) missing_for_eye_.push_back({m, r.page});
    std::sort(pages_for_eye_.begin(), pages_for_eye_.end());
    pages_for_eye_.erase(std::unique(pages_for_eye_.begin(), pages_for_eye_.end()),
                         pages_for_eye_.end());
    size_t bytes = 0;
    for (const PageIndex page : pages_for_eye_) bytes += model.copy_bytes[page];
    if (!pages_.mayStay(bytes)) return true;
    bool all_copied = true;
    for (const PageIndex page : pages_for_eye_) {
        model.eye_used[page] = frame_number_;
        if (model.hasCopy(page)) continue;
        missing_for_eye_.push_back({m, page});
        all_copied = false;
    }
    if (!all_copied) return true;
    constexpr size_t kSlice = 16;
    const size_t count = cut_for_eye_.size();
    std::vector<EyeSide> parts((count + kSlice - 1) / kSlice, EyeSide(view.eye()));
    parallelFor(parts.size(), [&](size_t k) {
        for (size_t i = k * kSlice; i < std::min(count, (k + 1) * kSlice); ++i)
            parts[k].add(model.forest.node(cut_for_eye_[i]), *model.mesh(cut_for_eye_[i]));
    });
    EyeSide side(view.eye());
    for (const EyeSide& part : parts) side.add(part);
    model.side = side;
    model.side_pages = pages_for_eye_;
    return side.mayBeInside();
}

void Scene::Impl::describe(const SceneModel& model, uint32_t m, bool show_error,
                           ModelFrame& out) const {
    out.patches.clear();
    for (const NodeIndex i : out.selection.draw) {
        const Node& node = model.forest.node(i);
        if (node.triangles == 0) continue;
        DrawPatch patch;
        patch.mesh = model.mesh(i);
        patch.page = {m, node.page};
        patch.patch = node.patch;
        patch.one_sided = node.closed && !out.two_sided;
        patch.id = i + m * 0x9e3779b9u;
        patch.value = show_error ? float(out.view.errorInPixels(node.error, node.saturated))
                                 : float(node.level);
        out.patches.push_back(patch);
    }
}

Scene::Scene(std::vector<const ModelReader*> models, const SceneSettings& settings)
    : impl_(std::make_unique<Impl>(models, settings)) {}
Scene::~Scene() = default;

const Frame& Scene::update(const FrameRequest& request) {
    return impl_->update(request);
}

const Frame& Scene::converge(const FrameRequest& request) {
    for (;;) {
        if (Progress::cancelRequested()) throw Interrupted();
        const Frame& frame = impl_->update(request);
        if (frame.settled) return frame;
        std::this_thread::sleep_for(std::chrono::microseconds(200));
    }
}

const std::vector<std::string>& Scene::faults() const {
    return impl_->faults();
}

}  // namespace pietra
