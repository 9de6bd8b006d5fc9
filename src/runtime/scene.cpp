#include "runtime/scene.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <optional>

#include "base/check.h"
#include "base/error.h"
#include "base/text.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

using Clock = std::chrono::steady_clock;

/// How far ahead the camera is predicted, seconds, and the share of the tolerance that prefetching
/// goes to where it stands.
constexpr double kLookahead = 0.5, kNextLevel = 0.5;
/// A page used in the last frames is not evicted for one that may be used in the next.
constexpr uint32_t kFramesKept = 60;
/// Of the budget: below this the tolerance comes down again.
constexpr double kComfortable = 0.8;
/// By which the tolerance goes up in a frame that lacks memory, and down in one that has it.
constexpr double kRaise = 1.1, kLower = 0.99, kMostRaised = 1 << 20;

double msSince(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

/// Of each page in memory, with what its meshes are held by.
std::vector<size_t> residentPageBytes(const ModelReader& model) {
    std::vector<size_t> bytes = decodedPageBytes(model);
    for (const Node& node : model.nodes()) bytes[node.page] += sizeof(Mesh);
    return bytes;
}

}  // namespace

struct Scene::Model {
    explicit Model(const ModelReader& r)
        : reader(r),
          forest(r.nodes()),
          residency(forest, r.pageCount()),
          refiner(residency),
          closed_parts(closedPartsWithin(r.info(), r.nodes())),
          page_bytes(residentPageBytes(r)),
          last_used(r.pageCount(), 0),
          bad(r.pageCount(), 0),
          patches(r.pageCount()) {}

    const Mesh& mesh(NodeIndex i) const {
        return patches[forest.node(i).page][forest.node(i).patch];
    }

    /// It cannot be read, or depends on a page that cannot.
    bool hopeless(PageIndex page) const {
        if (residency.resident(page)) return false;
        const std::span<const PageIndex> above = residency.pagesAbove(page);
        return bad[page] != 0 ||
               std::any_of(above.begin(), above.end(), [&](PageIndex p) { return hopeless(p); });
    }

    const ModelReader& reader;
    Forest forest;
    Residency residency;
    ForestRefiner refiner;
    Box3d closed_parts;
    std::optional<EyeSide> side;  // of the last eye that was not decided by one before
    uint64_t side_departures = 0;
    std::vector<size_t> page_bytes;
    std::vector<uint32_t> last_used;         // a page: the frame
    std::vector<uint8_t> bad;                // a page: it cannot be read
    std::vector<std::vector<Mesh>> patches;  // of resident pages
};

class Scene::Impl {
public:
    Impl(std::vector<const ModelReader*> readers, const SceneSettings& settings)
        : settings_(settings) {
        for (const ModelReader* reader : readers)
            models_.push_back(std::make_unique<Model>(*reader));
        loadRoots();
        loader_ = std::make_unique<PageLoader>(std::move(readers), settings.loader_threads);
    }

    const Frame& update(const FrameRequest& request);
    bool idle() const { return !blocked_ && wanted_now_ == 0; }
    bool stuck() const { return blocked_ && tolerance_factor_ >= kMostRaised; }
    const std::vector<std::string>& faults() const { return faults_; }

private:
    struct Wanted {
        PageKey key;
        float pixels;
        bool soon;  // not needed now
    };
    struct Victim {
        PageKey key;
        uint32_t last_used;
    };

    void loadRoots();
    void publish();
    bool tryArrive(LoadedPage& page);
    void select(const FrameRequest& request);
    void addRequests(uint32_t m, const std::vector<PageRequest>& requests, bool soon);
    void prefetch(const FrameRequest& request);
    void load();
    bool makeRoom(size_t bytes, bool soon);
    void collectVictims();
    void evict(const PageKey& key);
    void adaptTolerance();
    bool mayBeInside(Model& model, const View& view);
    void describe(const Model& model, uint32_t m, bool show_error, ModelFrame& out) const;

    SceneSettings settings_;
    std::vector<std::unique_ptr<Model>> models_;
    std::vector<LoadedPage> waiting_;  // for pages that they depend on
    std::vector<Wanted> wanted_;
    std::vector<Victim> victims_;
    bool victims_known_ = false;
    size_t resident_bytes_ = 0, reserved_bytes_ = 0;
    size_t used_bytes_ = 0;  // of the pages that this frame needs and has
    size_t wanted_now_ = 0;
    bool blocked_ = false;  // something that is needed does not fit
    double tolerance_factor_ = 1;
    uint32_t frame_number_ = 0;
    Camera last_camera_;
    double last_seconds_ = 0;
    std::vector<std::string> faults_;
    Frame frame_;
    Selection scratch_;
    std::unique_ptr<PageLoader> loader_;  // last: its threads end first
};

void Scene::Impl::loadRoots() {
    size_t needed = 0;
    std::vector<std::vector<PageIndex>> pages(models_.size());
    for (size_t m = 0; m < models_.size(); ++m) {
        for (const NodeIndex root : models_[m]->forest.roots())
            pages[m].push_back(models_[m]->forest.node(root).page);
        std::sort(pages[m].begin(), pages[m].end());
        pages[m].erase(std::unique(pages[m].begin(), pages[m].end()), pages[m].end());
        for (const PageIndex page : pages[m]) needed += models_[m]->page_bytes[page];
    }
    if (needed > settings_.ram_bytes)
        throw MemoryError(fmt::format("the coarsest level needs {}", formatBytes(needed)));
    for (size_t m = 0; m < models_.size(); ++m)
        for (const PageIndex page : pages[m]) {
            models_[m]->reader.decode(page, models_[m]->patches[page]);
            models_[m]->residency.arrive(page);
            resident_bytes_ += models_[m]->page_bytes[page];
        }
}

const Frame& Scene::Impl::update(const FrameRequest& request) {
    const auto start = Clock::now();
    ++frame_number_;
    publish();
    frame_.publish_ms = msSince(start);
    select(request);
    if (request.prefetch) prefetch(request);
    load();
    adaptTolerance();
    last_camera_ = request.camera;
    last_seconds_ = request.seconds;
    frame_.resident_bytes = resident_bytes_ + reserved_bytes_;
    frame_.bytes_read = loader_->bytesRead();
    frame_.select_ms = msSince(start) - frame_.publish_ms;
    return frame_;
}

/// What is ready becomes resident, after what it waits for.
void Scene::Impl::publish() {
    loader_->take(waiting_);
    for (size_t i = 0; i < waiting_.size();) {
        if (!tryArrive(waiting_[i])) {
            ++i;
            continue;
        }
        waiting_.erase(waiting_.begin() + ptrdiff_t(i));
        i = 0;  // others may have waited for it
    }
}

/// True if the page is done with.
bool Scene::Impl::tryArrive(LoadedPage& page) {
    Model& model = *models_[page.key.model];
    if (!page.fault.empty()) {
        model.bad[page.key.page] = 1;
        faults_.push_back(fmt::format("{}: byte {}: {}", model.reader.path(),
                                      model.reader.page(page.key.page).offset, page.fault));
    } else {
        if (!model.residency.mayArrive(page.key.page)) return false;
        model.patches[page.key.page] = std::move(page.patches);
        model.residency.arrive(page.key.page);
        model.last_used[page.key.page] = frame_number_;
        resident_bytes_ += model.page_bytes[page.key.page];
    }
    return true;
}

void Scene::Impl::select(const FrameRequest& request) {
    wanted_.clear();
    const double pixels = request.pixels * tolerance_factor_;
    frame_.tolerance_px = request.pixels;
    frame_.triangles = frame_.patch_count = used_bytes_ = 0;
    for (uint32_t m = 0; m < models_.size(); ++m) {
        Model& model = *models_[m];
        const View view(request.camera, request.size, model.reader.info().lattice);
        if (frame_.models.size() <= m) frame_.models.emplace_back(view);
        ModelFrame& out = frame_.models[m];
        out.view = view;
        out.two_sided = mayBeInside(model, view);
        Culling culling = request.culling;
        culling.cone &= !out.two_sided;
        model.refiner.select(view, pixels, culling, out.selection);
        for (PageIndex page = 0; page < model.last_used.size(); ++page)
            if (model.refiner.used(page)) {
                model.last_used[page] = frame_number_;
                used_bytes_ += model.page_bytes[page];
            }
        addRequests(m, out.selection.requests, false);
        describe(model, m, request.show_error, out);
        frame_.tolerance_px = std::max(frame_.tolerance_px, out.selection.largest_px);
        frame_.triangles += out.selection.triangles;
        frame_.patch_count += out.patches.size();
    }
    std::stable_sort(wanted_.begin(), wanted_.end(),
                     [](const Wanted& a, const Wanted& b) { return a.pixels > b.pixels; });
    wanted_now_ = wanted_.size();
    frame_.converged = wanted_now_ == 0 && tolerance_factor_ == 1;
}

void Scene::Impl::addRequests(uint32_t m, const std::vector<PageRequest>& requests, bool soon) {
    for (const PageRequest& request : requests)
        if (!models_[m]->hopeless(request.page))
            wanted_.push_back({{m, request.page}, request.pixels, soon});
}

/// For where the camera will be in half a second, and for the next level where it is.
void Scene::Impl::prefetch(const FrameRequest& request) {
    const double dt = request.seconds - last_seconds_;
    Camera ahead = request.camera;
    if (frame_number_ > 1 && dt > 0 && dt < kLookahead) {
        const double steps = kLookahead / dt;
        ahead.eye += (request.camera.eye - last_camera_.eye) * steps;
        ahead.target += (request.camera.target - last_camera_.target) * steps;
        if (ahead.eye == ahead.target) ahead = request.camera;
    }
    const double pixels = request.pixels * tolerance_factor_;
    for (uint32_t m = 0; m < models_.size(); ++m) {
        Model& model = *models_[m];
        scratch_.requests.clear();
        model.refiner.prefetch(View(ahead, request.size, model.reader.info().lattice), pixels,
                               request.culling, scratch_.requests);
        model.refiner.prefetch(frame_.models[m].view, pixels * kNextLevel, request.culling,
                               scratch_.requests);
        addRequests(m, scratch_.requests, true);
    }
}

/// Hands the loader what fits into the budget, after evicting what has not been used for longest.
void Scene::Impl::load() {
    std::vector<PageKey> wanted, begun = loader_->forget();
    for (const LoadedPage& page : waiting_) begun.push_back(page.key);
    reserved_bytes_ = 0;
    for (const PageKey& key : begun) reserved_bytes_ += models_[key.model]->page_bytes[key.page];
    blocked_ = victims_known_ = false;
    for (const Wanted& page : wanted_) {
        if (std::find(begun.begin(), begun.end(), page.key) != begun.end()) continue;
        const size_t bytes = models_[page.key.model]->page_bytes[page.key.page];
        if (!makeRoom(bytes, page.soon)) {
            blocked_ = !page.soon;
            break;
        }
        reserved_bytes_ += bytes;
        wanted.push_back(page.key);
    }
    loader_->want(wanted);
}

bool Scene::Impl::makeRoom(size_t bytes, bool soon) {
    const auto fits = [&] {
        return resident_bytes_ + reserved_bytes_ + bytes <= settings_.ram_bytes;
    };
    if (fits()) return true;
    if (!victims_known_) collectVictims();
    // Those used longest ago come last. A page may become free by the going of others.
    for (bool again = true; again && !fits();) {
        again = false;
        for (size_t i = victims_.size(); i-- > 0 && !fits();) {
            const Victim victim = victims_[i];
            if (soon && victim.last_used + kFramesKept > frame_number_) break;
            if (!models_[victim.key.model]->residency.mayLeave(victim.key.page)) continue;
            evict(victim.key);
            victims_.erase(victims_.begin() + ptrdiff_t(i));
            again = true;
        }
    }
    return fits();
}

void Scene::Impl::collectVictims() {
    victims_known_ = true;
    victims_.clear();
    for (uint32_t m = 0; m < models_.size(); ++m)
        for (PageIndex page = 0; page < models_[m]->last_used.size(); ++page)
            if (models_[m]->residency.resident(page) &&
                models_[m]->last_used[page] != frame_number_)
                victims_.push_back({{m, page}, models_[m]->last_used[page]});
    std::sort(victims_.begin(), victims_.end(), [](const Victim& a, const Victim& b) {
        return a.last_used != b.last_used   ? a.last_used > b.last_used
               : a.key.model != b.key.model ? a.key.model > b.key.model
                                            : a.key.page < b.key.page;
    });
}

void Scene::Impl::evict(const PageKey& key) {
    Model& model = *models_[key.model];
    model.residency.leave(key.page);
    model.patches[key.page] = {};
    resident_bytes_ -= model.page_bytes[key.page];
}

void Scene::Impl::adaptTolerance() {
    if (blocked_)
        tolerance_factor_ = std::min(tolerance_factor_ * kRaise, kMostRaised);
    else if (wanted_now_ == 0 && double(used_bytes_) < kComfortable * double(settings_.ram_bytes))
        tolerance_factor_ = std::max(1.0, tolerance_factor_ * kLower);
}

bool Scene::Impl::mayBeInside(Model& model, const View& view) {
    if (!holds(model.closed_parts, view.eye())) return false;
    // What is drawn is no coarser than what decided the matter, as long as no page has left.
    const uint64_t departures = model.residency.departures();
    if (!model.side || departures != model.side_departures || !model.side->decides(view.eye())) {
        EyeSide& side = model.side.emplace(view.eye());
        model.side_departures = departures;
        model.refiner.visitDrawable(view, kEyeSidePixels, [&](NodeIndex i) {
            side.add(model.forest.node(i), model.mesh(i));
        });
    }
    return model.side->mayBeInside();
}

void Scene::Impl::describe(const Model& model, uint32_t m, bool show_error, ModelFrame& out) const {
    out.patches.clear();
    for (const NodeIndex i : out.selection.draw) {
        const Node& node = model.forest.node(i);
        if (node.triangles == 0) continue;
        DrawPatch patch;
        patch.mesh = &model.mesh(i);
        patch.one_sided = node.closed && !out.two_sided;
        patch.id = i + m * 0x9e3779b9u;
        patch.value = show_error ? float(out.view.errorInPixels(node.error, node.saturated))
                                 : float(node.level);
        out.patches.push_back(patch);
    }
}

Scene::Scene(std::vector<const ModelReader*> models, const SceneSettings& settings)
    : impl_(std::make_unique<Impl>(std::move(models), settings)) {}
Scene::~Scene() = default;

const Frame& Scene::update(const FrameRequest& request) {
    return impl_->update(request);
}

const Frame& Scene::converge(const FrameRequest& request) {
    for (;;) {
        const Frame& frame = impl_->update(request);
        if (impl_->idle() || impl_->stuck()) return frame;
        std::this_thread::sleep_for(std::chrono::milliseconds(1));
    }
}

const std::vector<std::string>& Scene::faults() const {
    return impl_->faults();
}

}  // namespace pietra
