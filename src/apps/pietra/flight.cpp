#include "apps/pietra/flight.h"

#include <time.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <fstream>
#include <memory>
#include <sstream>

#include "apps/pietra/static_list.h"
#include "base/budget.h"
#include "base/check.h"
#include "base/stopwatch.h"
#include "render/live/gl_live.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

constexpr int kSampledFrames = 24;
constexpr int kRepeats = 3;
constexpr double kMostWaitMs = 60'000;

class Flight {
public:
    Flight(const std::vector<const ModelReader*>& models, const CameraPath& path,
           const FlightSettings& settings)
        : models_(models),
          path_(path),
          settings_(settings),
          renderer_(makeRenderer()),
          scene_(models, sceneSettings()) {}

    FlightRecord run(const std::function<void(int)>& progress) {
        const Stopwatch watch;
        for (int i = 0; i < settings_.frames; ++i) {
            if (settings_.real_time) watch.wait(timeOf(i));
            FrameRequest view = request(i);
            if (i > 0) view.seen = seenOrNull(seen_);
            record_.frames.push_back(frame(view));
            record_.frames.back().seconds = timeOf(i);
            record_.frames.back().process_bytes = residentBytes();
            progress(i);
        }
        record_.seconds = watch.seconds();
        awaitConvergence();
        if (settings_.compare) compareWithStaticDraws(progress);
        record_.faults = scene_.faults();
        return std::move(record_);
    }

private:
    using Draw = FlightSettings::Draw;

    std::unique_ptr<LiveRenderer> makeRenderer() const {
        if (settings_.draw == Draw::kNothing) return nullptr;
        if (settings_.draw == Draw::kCpu) return makeRasterLive();
        // More than all pages take, the ring beside them, need not be there.
        size_t all = size_t(4) << 20;
        for (const ModelReader* model : models_)
            for (const size_t page : decodedPageBytes(*model)) all += page + page / 6;
        return std::make_unique<GlLive>(GlContext::headless(settings_.gl_messages), settings_.size,
                                        std::min(settings_.vram_bytes, all));
    }

    SceneSettings sceneSettings() const {
        SceneSettings scene = settings_.scene;
        if (renderer_) scene.sink = renderer_->sink();
        return scene;
    }

    double timeOf(int i) const {
        return settings_.frames == 1 ? 0 : path_.seconds * i / (settings_.frames - 1);
    }

    FrameRequest request(int i) const {
        FrameRequest request;
        request.camera = path_.frame(i, settings_.frames);
        request.size = settings_.size;
        request.pixels = settings_.pixels;
        request.select = settings_.select;
        request.seconds = timeOf(i);
        request.culling = settings_.culling;
        request.prefetch = settings_.prefetch;
        return request;
    }

    FrameRecord frame(const FrameRequest& request) {
        const Stopwatch watch;
        const Frame& frame = scene_.update(request);
        FrameRecord record;
        record.select_ms = frame.select_ms;
        record.adapt_ms = frame.adapt_ms;
        record.load_ms = frame.publish_ms;
        if (renderer_) {
            record.draw_ms = draw(frame, patchesOf(frame), looks_ ? &request.camera : nullptr);
            record.gpu_ms = renderer_->gpuMs();
        }
        if (const SeenDepth* seen = looks_ ? renderer_->seen() : nullptr) seen_ = *seen;
        record.ms = watch.ms();
        record.triangles = frame.triangles;
        record.patches = frame.patch_count;
        record.operations = frame.operations;
        record.bytes_read = frame.bytes_read - bytes_read_;
        bytes_read_ = frame.bytes_read;
        record.resident_bytes = frame.resident_bytes;
        record.device_bytes = frame.device_bytes;
        record.tolerance_px = frame.tolerance_px;
        record.converged = frame.converged;
        record.settled = frame.settled;
        if (record_.first_image_ms < 0 && record.tolerance_px <= kFirstImagePx)
            record_.first_image_ms = msSinceStart();
        return record;
    }

    using Lists = std::vector<std::span<const DrawPatch>>;

    static Lists patchesOf(const Frame& frame) {
        Lists lists;
        for (const ModelFrame& model : frame.models) lists.emplace_back(model.patches);
        return lists;
    }

    const SeenDepth* seenOrNull(const SeenDepth& seen) const { return looks_ ? &seen : nullptr; }

    /// `camera`: as LiveSettings has it.
    double draw(const Frame& frame, const Lists& lists, const Camera* camera = nullptr) {
        const Stopwatch watch;
        std::vector<ModelPatches> list;
        for (size_t m = 0; m < frame.models.size(); ++m)
            list.push_back({frame.models[m].view, &models_[m]->info().lattice, lists[m]});
        renderer_->draw(list,
                        {{}, settings_.samples, settings_.culling.occlusion, nullptr, camera});
        renderer_->wait();
        return watch.ms();
    }

    void awaitConvergence() {
        const Stopwatch stopped;
        const SeenDepth seen = seen_;
        FrameRequest last = request(settings_.frames - 1);
        last.seen = seenOrNull(seen);
        while (stopped.ms() < kMostWaitMs) {
            last.seconds += 1.0 / 60;
            const FrameRecord found = frame(last);
            if (found.converged) record_.converged_ms = stopped.ms();
            if (found.settled) return;
        }
    }

    /// At the flight's own pace: threads that wake up and cold caches are no overhead. What falls
    /// behind it, as the repeated draws of overheadRatio() do, is drawn without a rest, and faster.
    void compareWithStaticDraws(const std::function<void(int)>& progress) {
        const Stopwatch watch;
        for (int i = 0; i < settings_.frames; ++i) {
            const Frame& resident = scene_.converge(asSeen(i));
            if (settings_.real_time) watch.wait(timeOf(i));
            record_.frames[i].static_ms = draw(resident, patchesOf(resident));
            progress(i);
        }
        record_.overhead_ratio = overheadRatio();
    }

    double overheadRatio() {
        std::vector<double> ratios;
        const int step = std::max(1, settings_.frames / kSampledFrames);
        for (int i = 0; i < settings_.frames; i += step) {
            const FrameRequest view = asSeen(i);
            ratios.push_back(overhead(view, scene_.converge(view)));
        }
        return percentile(ratios, 0.5);
    }

    /// Frame i, without prefetching, and with what pictures hide from it.
    FrameRequest asSeen(int i) {
        FrameRequest view = request(i);
        view.prefetch = false;
        if (!looks_) return view;
        (void)scene_.converge(view);
        (void)frame(view);
        asked_ = seen_;
        view.seen = &asked_;
        return view;
    }

    /// Of the whole frame over the faster of two ways to draw it as a static thing: as one buffer,
    /// and as the patches it consists of, which suit the CPU renderer better.
    double overhead(const FrameRequest& view, const Frame& resident) {
        std::deque<StaticList> buffers;
        Lists merged;
        for (uint32_t m = 0; m < models_.size(); ++m) {
            buffers.emplace_back(*models_[m], resident.models[m].patches, PageKey{~m, 0},
                                 renderer_->sink());
            merged.push_back(buffers.back().patches());
        }
        const bool drawable = std::all_of(buffers.begin(), buffers.end(),
                                          [](const StaticList& list) { return list.drawable(); });
        std::vector<double> whole, still[2];
        for (int repeat = 0; repeat < kRepeats; ++repeat) {
            if (drawable) still[0].push_back(draw(resident, merged));
            still[1].push_back(draw(resident, patchesOf(resident)));
            whole.push_back(frame(view).ms);
        }
        const double list_ms = percentile(still[1], 0.5);
        return percentile(whole, 0.5) /
               (drawable ? std::min(list_ms, percentile(still[0], 0.5)) : list_ms);
    }

    std::vector<const ModelReader*> models_;
    const CameraPath& path_;
    const FlightSettings& settings_;
    std::unique_ptr<LiveRenderer> renderer_;  // null: nothing is drawn
    // Whether what pictures hide is told to the scene. One model hides little of itself (README of
    // pmesh); and pictures of several samples have no one depth.
    const bool looks_ =
        models_.size() > 1 &&
        settings_.draw != Draw::kNothing&& settings_.culling.occlusion&& settings_.samples == 1;
    SeenDepth seen_;   // of the last picture
    SeenDepth asked_;  // of the picture that a frame is compared by
    Scene scene_;
    uint64_t bytes_read_ = 0;
    FlightRecord record_;
};

}  // namespace

double msSinceStart() {
    std::ifstream file("/proc/self/stat");
    std::string text;
    std::getline(file, text);
    // The 22nd field; the second, a name in brackets, may hold anything.
    std::istringstream fields(text.substr(text.rfind(')') + 1));
    for (int field = 3; field < 22; ++field) fields >> text;
    double ticks = 0;
    fields >> ticks;
    timespec now{};
    ::clock_gettime(CLOCK_BOOTTIME, &now);
    return double(now.tv_sec) * 1e3 + double(now.tv_nsec) * 1e-6 -
           ticks * 1e3 / double(::sysconf(_SC_CLK_TCK));
}

FlightRecord fly(const std::vector<const ModelReader*>& models, const CameraPath& path,
                 const FlightSettings& settings, const std::function<void(int)>& progress) {
    CHECK(settings.frames >= 1 && !models.empty());
    return Flight(models, path, settings).run(progress);
}

double percentile(std::vector<double> values, double p) {
    if (values.empty()) return 0;
    const size_t rank = std::min(values.size() - 1, size_t(p * double(values.size())));
    std::nth_element(values.begin(), values.begin() + ptrdiff_t(rank), values.end());
    return values[rank];
}

}  // namespace pietra
