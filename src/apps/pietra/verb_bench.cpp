// pietra bench: a camera path flown through models, and measured.

#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/pietra/camera_json.h"
#include "apps/pietra/camera_options.h"
#include "apps/pietra/draw_options.h"
#include "apps/pietra/flight_report.h"
#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/model_files.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "extmem/page_cache.h"
#include "methods/method_table.h"
#include "runtime/standard_paths.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

constexpr double kFramesPerSecond = 60;

class BenchVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    CameraPath path(const ModelFiles& files) const;
    FlightSettings settings(const ModelFiles& files, const CameraPath& path) const;
    void dropCaches() const;
    FlightRecord flyOnce(const ModelFiles& files, const CameraPath& path,
                         const FlightSettings& settings, const char* stage,
                         Progress& progress) const;
    Json report(const BenchRecord& record, const CameraPath& path, bool proven) const;

    std::vector<std::string> files_;
    std::string path_;
    CameraOptions camera_;
    std::optional<uint64_t> frames_;
    PictureSize size_;
    double pixels_ = 1;
    std::string renderer_ = "cpu";
    std::string samples_ = "1";
    SelectOption select_;
    CullOption cull_;
    std::string prefetch_ = "on";
    uint64_t ram_ = uint64_t(1) << 30, vram_ = uint64_t(1) << 30;
    bool only_fly_ = false, cold_ = false;
    std::string html_;
    std::optional<uint64_t> jobs_;
};

VerbText BenchVerb::text() const {
    return {
        "bench",
        "fly a camera path through models, and measure it",
        {"FILE... --path PATH [options]"},
        {"Flies a recorded path, or one that every model has, with a fixed step of time, so that "
         "frame i shows the same view on every machine, and reports what frames took and drew. "
         "Warm, it flies as fast as it can; with --cold in real time, with what the system has "
         "cached of the files dropped before.",
         "A frame waits for no file: what has not been loaded yet is drawn coarser, without "
         "holes, and the tolerance that each frame keeps to is in the report."},
        {{"an orbit around the model", "pietra bench moon.pietra --path orbit"},
         {"a recorded flight, as a user sees it after a reboot",
          "pietra bench moon.pietra --path flight.json --cold --report r.json"},
         {"what Adaptive TetraPuzzles were measured by, with a page of graphs",
          "pietra bench m.pietra --path inspection --size 800x600 --pixels 2 --samples 4 --cold "
          "--html r.html"}},
        "Paths that every model has",
        {{"orbit", "around the whole, from above and below"},
         {"dive", "from the whole to close above its surface"},
         {"flight", "low over it, along its longer side"},
         {"jumps", "views from all around and near, each for a second"},
         {"inspection",
          "turns, and rapid changes from the whole to extreme close-ups, 45 seconds"}}};
}

void BenchVerb::declare(OptionSet& options) {
    options.files("FILE", files_, "The models.").require();
    options
        .text("--path", "PATH", path_,
              "A camera path: orbit, dive, flight, jumps, inspection, or a file: {\"seconds\":20, "
              "\"keys\":[{\"t\":0, \"eye\":[x,y,z], \"target\":[x,y,z], \"up\":[x,y,z], "
              "\"fovy_deg\":45}, ...]}.")
        .require();
    camera_.declareUp(options, "Which axis points up where the path does not say.");
    options.count("--frames", "N", frames_, {.min = 1, .max = 1000000}, "Frames of the path.")
        .defaultsTo("60 a second");
    options.pictureSize("--size", size_, "Of the picture, in pixels.");
    options.number("--pixels", "T", pixels_, {.min = 0}, "Tolerance in pixels.");
    select_.declare(options);
    options.choice("--renderer", renderer_, {"cpu", "gl", "none"}, "What draws.");
    options.choice("--samples", samples_, {"1", "4"}, "Coverage samples a pixel.");
    cull_.declare(options, "What is left out, as for render.");
    options.choice("--prefetch", prefetch_, {"on", "off"},
                   "Load what views to come will need, too.");
    options.size("--ram", ram_, "Most memory for what is loaded.");
    declareVram(options, vram_);
    options.flag("--only-fly", only_fly_,
                 "Leave out what is measured after the flight, in as much time again: the same "
                 "views with everything loaded, and as static lists.");
    options.flag("--cold", cold_, "Drop the system's cache of the files, and fly in real time.");
    options.text("--html", "R.html", html_,
                 "Write a page with graphs, too; for it the path is flown again without drawing "
                 "and without prefetching.");
    options.count("-j,--jobs", "N", jobs_, {.min = 1, .max = 1024}, "Threads to work with.")
        .defaultsTo("all cores");
}

CameraPath BenchVerb::path(const ModelFiles& files) const {
    if (const auto known = parseStandardPath(path_))
        return standardPath(*known, coarseSurface(files.views(), openLive), camera_.up(), size_);
    return readCameraPath(path_, upVector(camera_.up()));
}

FlightSettings BenchVerb::settings(const ModelFiles& files, const CameraPath& path) const {
    FlightSettings settings;
    settings.frames =
        frames_ ? int(*frames_) : 1 + int(std::lround(path.seconds * kFramesPerSecond));
    settings.size = size_;
    settings.pixels = pixels_;
    settings.select = select_.selectBy(files.views());
    settings.culling = cull_.culling();
    settings.prefetch = prefetch_ == "on";
    settings.samples = samples_ == "4" ? 4 : 1;
    using Draw = FlightSettings::Draw;
    settings.draw = renderer_ == "gl"    ? Draw::kGl
                    : renderer_ == "cpu" ? Draw::kCpu
                                         : Draw::kNothing;
    settings.vram_bytes = size_t(vram_);
    settings.compare = settings.draw != Draw::kNothing && !only_fly_;
    settings.real_time = cold_;
    settings.scene.ram_bytes = size_t(ram_);
    settings.scene.open_live = openLive;
    return settings;
}

/// What the system calls the processor, and how many threads it has for us.
std::string machine() {
    std::ifstream file("/proc/cpuinfo");
    std::string name = "processor";
    for (std::string line; std::getline(file, line);)
        if (line.starts_with("model name")) {
            name = line.substr(std::min(line.size(), line.find(':') + 2));
            break;
        }
    return fmt::format("{}, {} threads", name, Limits{}.threads());
}

std::string sentence(const FlightRecord& record, const Json& summary) {
    return fmt::format(
        "{} frames in {:.1f} s; a frame {:.1f} ms (median), {:.1f} ms (99 %); {} triangles/s; "
        "first image after {:.0f} ms, converged {:.0f} ms after the last frame",
        record.frames.size(), record.seconds, summary["ms_of_all"]["median"].get<double>(),
        summary["ms_of_all"]["p99"].get<double>(),
        formatCount(summary["triangles_per_second"].get<double>()), record.first_image_ms,
        record.converged_ms);
}

Json BenchVerb::report(const BenchRecord& record, const CameraPath& path, bool proven) const {
    Json report{
        {"model", files_.size() == 1 ? Json(files_[0]) : Json(files_)},
        {"renderer", renderer_},
        {"size", {size_.width, size_.height}},
        {"pixels", pixels_},
        {"select", select_.word()},
        {"errors_proven", proven},
        {"about", fmt::format("{}, {}x{}, {} px, {} samples, {} for pages, {}{}; {}", path_,
                              size_.width, size_.height, pixels_, samples_, formatBytes(ram_),
                              renderer_, cold_ ? ", cold" : "", machine())}};
    report.update(flightJson(record.flight, pixels_, cold_));
    report["summary"]["peak_rss_bytes"] = record.peak_bytes;
    report["summary"]["rss_before_bytes"] = record.process_bytes_before;
    if (record.without_prefetch)
        report["without_prefetch"] = flightJson(*record.without_prefetch, pixels_, false);
    if (record.without_drawing)
        report["without_drawing"] = flightJson(*record.without_drawing, pixels_, false);
    report["path"] = Json::parse(cameraPathText(path));
    return report;
}

/// Of cold flights, before each.
void BenchVerb::dropCaches() const {
    for (const std::string& file : files_)
        if (const uint64_t left = dropPageCache(file); left > 0)
            logWarning(fmt::format("{}: the system still caches {} of it: this is no cold flight",
                                   file, formatBytes(left)));
}

FlightRecord BenchVerb::flyOnce(const ModelFiles& files, const CameraPath& path,
                                const FlightSettings& settings, const char* stage,
                                Progress& progress) const {
    if (cold_) dropCaches();
    progress.beginStage(stage, uint64_t(settings.frames) * (settings.compare ? 2 : 1));
    try {
        FlightRecord record = fly(files.views(), path, settings, [&](int) { progress.tick(1); });
        progress.endStage();
        return record;
    } catch (const MemoryError& error) {
        throw MemoryError(memoryMessage(ram_, renderer_ == "gl" ? vram_ : 0, error));
    } catch (const UsageError& error) {
        throw UsageError(fmt::format("--renderer {}: {}", renderer_, error.what()));
    }
}

int BenchVerb::run(const RunContext& context) {
    shareHeap();
    const ThreadLimit threads(Limits{{}, jobs_}.threads());
    checkOutput(context.common.report, context.common.force);
    checkOutput(html_, context.common.force);
    BenchRecord record;
    record.process_bytes_before = residentBytes();
    if (cold_) dropCaches();
    const ModelFiles files(files_);
    const CameraPath camera_path = path(files);
    FlightSettings flight = settings(files, camera_path);
    flight.gl_messages = glMessages(context.common);
    const bool variants = !html_.empty() && flight.draw != FlightSettings::Draw::kNothing;
    context.progress.setStages(variants ? 3 : 1);
    record.flight = flyOnce(files, camera_path, flight, "fly", context.progress);
    record.peak_bytes = peakResidentBytes();
    flight.compare = false;
    if (variants) {
        flight.prefetch = false;
        record.without_prefetch =
            flyOnce(files, camera_path, flight, "fly without prefetching", context.progress);
        flight.prefetch = prefetch_ == "on";
        flight.draw = FlightSettings::Draw::kNothing;
        record.without_drawing =
            flyOnce(files, camera_path, flight, "fly without drawing", context.progress);
    }
    for (const std::string& fault : record.flight.faults) logWarning(fault);
    const Json json = report(record, camera_path, files.proveErrors());
    logInfo(sentence(record.flight, json["summary"]));
    writeReport(context.common.report, json, context.common.force);
    if (!html_.empty()) writeText(html_, flightPage(record, json), context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeBenchVerb() {
    return std::make_unique<BenchVerb>();
}

}  // namespace pietra
