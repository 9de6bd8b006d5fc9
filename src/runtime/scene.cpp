#include "runtime/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <limits>
#include <utility>

#include "base/error.h"
#include "base/progress.h"
#include "base/stopwatch.h"
#include "base/text.h"
#include "runtime/scene_meshes.h"
#include "runtime/scene_patches.h"
#include "runtime/scene_tolerance.h"

namespace pietra {
namespace {

/// How far ahead the camera is predicted, seconds, and the share of the tolerance that prefetching
/// goes to where it stands.
constexpr double kLookahead = 0.5, kNextLevel = 0.5;
constexpr uint32_t kPrefetchFrames = 4;
/// What patches let go of at a time for adapted meshes, and the other way round.
constexpr size_t kReleasedBytes = size_t(2) << 20;

std::vector<const ModelReader*> thoseThat(const std::vector<const ModelReader*>& all,
                                          bool have_patches) {
    std::vector<const ModelReader*> some;
    for (const ModelReader* reader : all)
        if (reader->hasPatches() == have_patches) some.push_back(reader);
    return some;
}

size_t tablesOf(const std::vector<const ModelReader*>& readers) {
    size_t bytes = 0;
    for (const ModelReader* reader : readers) bytes += tableBytes(*reader);
    return bytes;
}

}  // namespace

size_t tableBytes(const ModelReader& model) {
    constexpr size_t kBesideNode = 32;  // forest.h, residency.h, forest_refiner.h
    return model.nodes().size() * (sizeof(Node) + kBesideNode);
}

class Scene::Impl {
public:
    Impl(const std::vector<const ModelReader*>& readers, const SceneSettings& settings);
    const Frame& update(const FrameRequest& request);
    const std::vector<std::string>& faults();

private:
    /// A model of the scene: one of patches_, or of meshes_.
    struct Part {
        const ModelReader* reader;
        bool is_live;
        uint32_t index;
    };

    void select(const FrameRequest& request);
    void load(const FrameRequest& request);
    void prefetch(const FrameRequest& request);
    Camera cameraAhead(const FrameRequest& request) const;
    void adaptTolerance(const FrameRequest& request);
    bool isBlocked();
    double usedShare() const;

    std::vector<Part> parts_;
    size_t table_bytes_ = 0;
    ScenePatches patches_;
    SceneMeshes meshes_;
    SceneTolerance tolerance_;
    uint32_t frame_number_ = 0;
    FrameRequest last_;
    Frame frame_;
    std::vector<std::string> faults_;
};

Scene::Impl::Impl(const std::vector<const ModelReader*>& readers, const SceneSettings& settings)
    : table_bytes_(tablesOf(readers)),
      patches_(thoseThat(readers, true), table_bytes_, settings),
      meshes_(thoseThat(readers, false), settings, uint32_t(patches_.size())) {
    uint32_t patches = 0, meshes = 0;
    for (const ModelReader* reader : readers)
        parts_.push_back(reader->hasPatches() ? Part{reader, false, patches++}
                                              : Part{reader, true, meshes++});
    const PagePool& pages = patches_.pages();
    const size_t needed = pages.ramBytes() + meshes_.pool().bytes();
    if (needed > pages.ramBudget())
        throw MemoryError(fmt::format("the tables and the coarsest level need {}",
                                      formatBytes(table_bytes_ + needed)));
    meshes_.uploadRoots(pages.deviceBudget());
    last_.seconds = -std::numeric_limits<double>::infinity();
}

const Frame& Scene::Impl::update(const FrameRequest& request) {
    const Stopwatch watch;
    ++frame_number_;
    patches_.beginFrame();
    meshes_.pool().publish();
    frame_.publish_ms = watch.ms();
    select(request);
    load(request);
    adaptTolerance(request);
    last_ = request;
    const PagePool& pages = patches_.pages();
    frame_.resident_bytes = pages.ramBytes() + meshes_.pool().bytes() + table_bytes_;
    frame_.device_bytes = pages.deviceBytes();
    frame_.bytes_read = pages.bytesRead() + meshes_.pool().bytesRead();
    frame_.select_ms = watch.ms() - frame_.publish_ms;
    return frame_;
}

const std::vector<std::string>& Scene::Impl::faults() {
    faults_ = patches_.pages().faults();
    const std::vector<std::string>& others = meshes_.pool().faults();
    faults_.insert(faults_.end(), others.begin(), others.end());
    return faults_;
}

/// What is drawn.
void Scene::Impl::select(const FrameRequest& request) {
    const double pixels = request.pixels * tolerance_.factor();
    frame_.tolerance_px = request.pixels;
    frame_.triangles = frame_.patch_count = 0;
    frame_.adapt_ms = 0;
    for (uint32_t i = 0; i < parts_.size(); ++i) {
        const Part& part = parts_[i];
        const View view = request.viewFrom(request.camera, part.reader->info());
        if (frame_.models.size() <= i) frame_.models.emplace_back(view);
        ModelFrame& out = frame_.models[i];
        out.view = view;
        double largest_px = 0;
        if (part.is_live) {
            const Stopwatch watch;
            largest_px = meshes_.adapt(part.index, request, pixels, patches_.pages(), out);
            frame_.adapt_ms += watch.ms();
            for (const DrawPatch& patch : out.patches)
                frame_.triangles += patch.mesh->triangleCount();
        } else {
            patches_.select(part.index, request, pixels, out);
            largest_px = out.selection.largest_px;
            frame_.triangles += out.selection.triangles;
        }
        frame_.tolerance_px = std::max(frame_.tolerance_px, largest_px);
        frame_.patch_count += out.patches.size();
    }
    frame_.operations = meshes_.pool().operations();
}

void Scene::Impl::load(const FrameRequest& request) {
    PagePool& pages = patches_.pages();
    LivePool& meshes = meshes_.pool();
    patches_.wantMissing();
    // What others let go of is for what is needed, then.
    const bool is_short = pages.blocked() || meshes.shortOfMemory();
    request.prefetch && !is_short ? prefetch(request) : meshes.forgetPrefetch();
    pages.setElsewhere(meshes.bytes(), meshes.lackingBytes());
    pages.load();
    meshes.load(pages.freeRam());
}

/// For where the camera will be in half a second, and for the next level where it is: these change
/// little from frame to frame, so that each is looked up anew in one frame of kPrefetchFrames.
void Scene::Impl::prefetch(const FrameRequest& request) {
    const uint32_t turn = frame_number_ % kPrefetchFrames;
    const bool next_level = turn == kPrefetchFrames / 2;
    if (turn == 0 || next_level) {
        const Camera camera = next_level ? request.camera : cameraAhead(request);
        const double pixels = request.pixels * tolerance_.factor() * (next_level ? kNextLevel : 1);
        patches_.prefetch(camera, request, pixels, next_level);
        for (const Part& part : parts_)
            if (part.is_live)
                meshes_.pool().prefetch(part.index, request.viewFrom(camera, part.reader->info()),
                                        pixels, next_level);
    }
    patches_.wantPrefetched();
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

void Scene::Impl::adaptTolerance(const FrameRequest& request) {
    const size_t missing = patches_.pages().missing() + meshes_.pool().missing();
    frame_.raised = tolerance_.factor() > 1;
    frame_.converged = missing == 0 && !frame_.raised;
    tolerance_.adapt({.same_request = last_.sameView(request),
                      .blocked = isBlocked(),
                      .missing = missing,
                      .used_share = usedShare()});
    frame_.settled = tolerance_.settled();
}

/// Something needed does not fit, and nobody has anything that is not needed.
bool Scene::Impl::isBlocked() {
    PagePool& pages = patches_.pages();
    LivePool& meshes = meshes_.pool();
    if (pages.blocked()) return !pages.blockedInRam() || meshes.release(kReleasedBytes) == 0;
    if (meshes_.shortOfSink() && pages.releaseDevice(kReleasedBytes) == 0) return true;
    return meshes.shortOfMemory() &&
           meshes.release(kReleasedBytes) + pages.release(kReleasedBytes) == 0;
}

/// Of the memory of which this frame uses the larger part.
double Scene::Impl::usedShare() const {
    const PagePool& pages = patches_.pages();
    const bool has_sink = pages.deviceBudget() > 0;
    const size_t used = patches_.usedBytes();
    const size_t in_ram = meshes_.pool().neededBytes() + (has_sink ? 0 : used);
    const double ram = double(in_ram) / double(pages.ramBudget());
    if (!has_sink) return ram;
    // Meshes that are adapted do not use all of a sink.
    const double device = double(used) + double(meshes_.uploadedBytes()) / LiveUploads::kUsable;
    return std::max(ram, device / double(pages.deviceBudget()));
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
