#include "runtime/scene.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/progress.h"
#include "base/stopwatch.h"
#include "runtime/page_pool.h"
#include "runtime/scene_tolerance.h"

namespace pietra {
namespace {

/// How far ahead the camera is predicted, seconds, and the share of the tolerance that prefetching
/// goes to where it stands.
constexpr double kLookahead = 0.5, kNextLevel = 0.5;
constexpr uint32_t kPrefetchFrames = 4;

}  // namespace

size_t tableBytes(const ModelReader& model) {
    constexpr size_t kBesideNode = 48;  // forest.h, residency.h, forest_refiner.h
    return model.nodes().size() * (sizeof(Node) + kBesideNode);
}

class Scene::Impl {
public:
    Impl(const std::vector<const ModelReader*>& readers, const SceneSettings& settings)
        : models_(makeModels(readers)),
          table_bytes_(tablesOf(readers)),
          pages_(models_, settings.ram_bytes, table_bytes_, settings.loader_threads,
                 settings.sink) {
        last_.seconds = -std::numeric_limits<double>::infinity();
    }

    const Frame& update(const FrameRequest& request);
    const std::vector<std::string>& faults() const { return pages_.faults(); }

private:
    struct Missing {
        PageKey key;
        float pixels;
    };

    static SceneModels makeModels(const std::vector<const ModelReader*>& readers);
    static size_t tablesOf(const std::vector<const ModelReader*>& readers);
    void select(const FrameRequest& request);
    void wantMissing();
    void prefetch(const FrameRequest& request);
    Camera cameraAhead(const FrameRequest& request) const;
    std::vector<PageKey> pagesFor(const Camera& camera, const FrameRequest& request, double share);
    bool mayBeInside(uint32_t m, const View& view);
    void describe(const SceneModel& model, uint32_t m, bool show_error, ModelFrame& out) const;

    SceneModels models_;
    const size_t table_bytes_;
    PagePool pages_;
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
    frame_.publish_ms = watch.ms();
    select(request);
    wantMissing();
    if (request.prefetch) prefetch(request);
    pages_.load();
    frame_.raised = tolerance_.factor() > 1;
    frame_.converged = pages_.missing() == 0 && !frame_.raised;
    tolerance_.adapt({.same_request = last_.sameView(request),
                      .blocked = pages_.blocked(),
                      .missing = pages_.missing(),
                      .used = used_bytes_,
                      .budget = pages_.drawn().budget});
    frame_.settled = tolerance_.settled();
    last_ = request;
    frame_.resident_bytes = pages_.ramBytes() + table_bytes_;
    frame_.device_bytes = pages_.deviceBytes();
    frame_.bytes_read = pages_.bytesRead();
    frame_.select_ms = watch.ms() - frame_.publish_ms;
    return frame_;
}

void Scene::Impl::select(const FrameRequest& request) {
    missing_.clear();
    missing_for_eye_.clear();
    const double pixels = request.pixels * tolerance_.factor();
    frame_.tolerance_px = request.pixels;
    frame_.triangles = frame_.patch_count = used_bytes_ = 0;
    for (uint32_t m = 0; m < models_.size(); ++m) {
        SceneModel& model = *models_[m];
        const View view(request.camera, request.size, model.reader.info().lattice);
        if (frame_.models.size() <= m) frame_.models.emplace_back(view);
        ModelFrame& out = frame_.models[m];
        out.view = view;
        out.two_sided = mayBeInside(m, view);
        Culling culling = request.culling;
        culling.cone &= !out.two_sided;
        model.refiner.select(view, pixels, culling, out.selection);
        for (PageIndex page = 0; page < model.last_used.size(); ++page)
            if (model.refiner.used(page)) {
                model.last_used[page] = frame_number_;
                used_bytes_ += model.drawn_bytes[page];
            }
        for (const PageRequest& r : out.selection.requests)
            missing_.push_back({{m, r.page}, r.pixels});
        describe(model, m, request.show_error, out);
        frame_.tolerance_px = std::max(frame_.tolerance_px, out.selection.largest_px);
        frame_.triangles += out.selection.triangles;
        frame_.patch_count += out.patches.size();
    }
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
    // What is drawn is no coarser than what decided the matter, as long as no page has left.
    const uint64_t departures = model.residency.departures();
    if (model.side && departures == model.side_departures && model.side->decides(view.eye()))
        return model.side->mayBeInside();
    model.side.reset();
    cut_for_eye_.clear();
    pages_for_eye_.clear();
    model.refiner.visitDrawable(view, kEyeSidePixels, [&](NodeIndex i) {
        cut_for_eye_.push_back(i);
        pages_for_eye_.push_back(model.forest.node(i).page);
    });
    std::sort(pages_for_eye_.begin(), pages_for_eye_.end());
    pages_for_eye_.erase(std::unique(pages_for_eye_.begin(), pages_for_eye_.end()),
                         pages_for_eye_.end());
    size_t bytes = 0;
    for (const PageIndex page : pages_for_eye_) bytes += model.copy_bytes[page];
    if (!pages_.mayStay(bytes)) return true;
    const size_t missing_before = missing_for_eye_.size();
    for (const PageIndex page : pages_for_eye_) {
        model.eye_used[page] = frame_number_;
        if (!model.hasCopy(page)) missing_for_eye_.push_back({m, page});
    }
    if (missing_for_eye_.size() > missing_before) return true;
    EyeSide side(view.eye());
    for (const NodeIndex i : cut_for_eye_) side.add(model.forest.node(i), *model.mesh(i));
    model.side = side;
    model.side_departures = departures;
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
