// pietra bench: a camera path flown through models, and measured.

#include <fcntl.h>
#include <fmt/format.h>

#include <cmath>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/pietra/camera_json.h"
#include "apps/pietra/draw_options.h"
#include "apps/pietra/flight.h"
#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/model_files.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "extmem/file.h"
#include "runtime/patch_reader.h"
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
    FlightSettings settings(const CameraPath& path) const;
    Json report(const FlightRecord& record) const;

    std::vector<std::string> files_;
    std::string path_;
    std::string up_ = "z";
    std::optional<uint64_t> frames_;
    PictureSize size_;
    double pixels_ = 1;
    std::string renderer_ = "cpu";
    std::string samples_ = "1";
    CullOption cull_;
    std::string prefetch_ = "on";
    uint64_t ram_ = uint64_t(1) << 30, vram_ = uint64_t(1) << 30;
    bool cold_ = false;
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
          "pietra bench moon.pietra --path flight.json --cold --report r.json"}},
        "Paths that every model has",
        {{"orbit", "around the whole, from above and below"},
         {"dive", "from the whole to close above its surface"},
         {"flight", "low over it, along its longer side"},
         {"jumps", "views from all around and near, each for a second"}}};
}

void BenchVerb::declare(OptionSet& options) {
    options.files("FILE", files_, "The models.").require();
    options
        .text("--path", "PATH", path_,
              "A camera path: orbit, dive, flight, jumps, or a file: {\"seconds\":20, "
              "\"keys\":[{\"t\":0, \"eye\":[x,y,z], \"target\":[x,y,z], \"up\":[x,y,z], "
              "\"fovy_deg\":45}, ...]}.")
        .require();
    options.choice("--up", up_, {"y", "z"}, "Which axis points up where the path does not say.");
    options.count("--frames", "N", frames_, {.min = 1, .max = 1000000}, "Frames of the path.")
        .defaultsTo("60 a second");
    options.pictureSize("--size", size_, "Of the picture, in pixels.");
    options.number("--pixels", "T", pixels_, {.min = 0}, "Tolerance in pixels.");
    options.choice("--renderer", renderer_, {"cpu", "gl", "none"}, "What draws.");
    options.choice("--samples", samples_, {"1", "4"}, "Coverage samples a pixel.");
    cull_.declare(options, "What is left out, as for render.");
    options.choice("--prefetch", prefetch_, {"on", "off"},
                   "Load what views to come will need, too.");
    options.size("--ram", ram_, "Most memory for what is loaded.");
    declareVram(options, vram_);
    options.flag("--cold", cold_, "Drop the system's cache of the files, and fly in real time.");
    options.count("-j,--jobs", "N", jobs_, {.min = 1, .max = 1024}, "Threads to work with.")
        .defaultsTo("all cores");
}

/// Has effect on pages that nobody else uses.
void dropSystemCache(const std::string& path) {
    const File file(path, File::Mode::kRead);
    ::posix_fadvise(file.descriptor(), 0, 0, POSIX_FADV_DONTNEED);
}

/// Vertices of the coarsest cuts.
std::vector<Vec3d> coarsePoints(const ModelFiles& files) {
    std::vector<Vec3d> points;
    std::mutex mutex;
    for (const auto& model : files.models)
        visitPatches(*model, rootCut(model->nodes()).nodes, [&](NodeIndex, const Mesh& mesh) {
            const std::lock_guard lock(mutex);
            for (const Vec3i& p : mesh.position) points.push_back(model->info().lattice.toInput(p));
        });
    // Patches come in any order.
    std::sort(points.begin(), points.end(), [](const Vec3d& a, const Vec3d& b) {
        return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
    });
    return points;
}

CameraPath BenchVerb::path(const ModelFiles& files) const {
    const bool y = up_ == "y";
    if (const auto known = parseStandardPath(path_))
        return standardPath(*known, coarsePoints(files), y ? UpAxis::kY : UpAxis::kZ, size_);
    return readCameraPath(path_, y ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1));
}

FlightSettings BenchVerb::settings(const CameraPath& path) const {
    FlightSettings settings;
    settings.frames =
        frames_ ? int(*frames_) : 1 + int(std::lround(path.seconds * kFramesPerSecond));
    settings.size = size_;
    settings.pixels = pixels_;
    settings.culling = cull_.culling();
    settings.prefetch = prefetch_ == "on";
    settings.samples = samples_ == "4" ? 4 : 1;
    using Draw = FlightSettings::Draw;
    settings.draw = renderer_ == "gl"    ? Draw::kGl
                    : renderer_ == "cpu" ? Draw::kCpu
                                         : Draw::kNothing;
    settings.vram_bytes = size_t(vram_);
    settings.real_time = cold_;
    settings.scene.ram_bytes = size_t(ram_);
    return settings;
}

/// JSON has no infinity: null.
Json finite(double value) {
    return std::isfinite(value) ? Json(value) : Json();
}

Json BenchVerb::report(const FlightRecord& record) const {
    Json frames = Json::array();
    std::vector<double> ms, gpu_ms;
    double triangles = 0;
    uint64_t bytes_read = 0;
    for (const FrameRecord& f : record.frames) {
        frames.push_back({{"ms", f.ms},
                          {"select_ms", f.select_ms},
                          {"load_ms", f.load_ms},
                          {"draw_ms", f.draw_ms},
                          {"triangles", f.triangles},
                          {"patches", f.patches},
                          {"operations", 0},
                          {"bytes_read", f.bytes_read},
                          {"gpu_ms", f.gpu_ms},
                          {"resident_bytes", {{"ram", f.resident_bytes}, {"vram", f.device_bytes}}},
                          {"tolerance_px", finite(f.tolerance_px)},
                          {"converged", f.converged}});
        triangles += double(f.triangles);
        bytes_read += f.bytes_read;
        ms.push_back(f.ms);
        gpu_ms.push_back(f.gpu_ms);
    }
    double busy_ms = 0;
    for (const double m : ms) busy_ms += m;
    Json summary{{"frames", record.frames.size()},
                 {"ms",
                  {{"median", percentile(ms, 0.5)},
                   {"p95", percentile(ms, 0.95)},
                   {"p99", percentile(ms, 0.99)},
                   {"max", percentile(ms, 1)}}},
                 {"gpu_ms", {{"median", percentile(gpu_ms, 0.5)}, {"max", percentile(gpu_ms, 1)}}},
                 {"seconds", record.seconds},
                 {"triangles_per_second", 1e3 * triangles / busy_ms},
                 {"operations_per_second", 0},
                 {"overhead_ratio", record.overhead_ratio},
                 {"stall_p99", record.stall_p99},
                 {"peak_rss_bytes", peakResidentBytes()},
                 {"bytes_read", bytes_read},
                 {"first_image_ms", record.first_image_ms},
                 {"converged_ms", record.converged_ms}};
    return {{"model", files_.size() == 1 ? Json(files_[0]) : Json(files_)},
            {"renderer", renderer_},
            {"size", {size_.width, size_.height}},
            {"pixels", pixels_},
            {"summary", summary},
            {"frames", frames}};
}

int BenchVerb::run(const RunContext& context) {
    const ThreadLimit threads(Limits{{}, jobs_}.threads());
    checkOutput(context.common.report, context.common.force);
    if (cold_)
        for (const std::string& file : files_) dropSystemCache(file);
    const ModelFiles files(files_);
    const CameraPath camera_path = path(files);
    FlightSettings flight = settings(camera_path);
    flight.gl_messages = glMessages(context.common);
    context.progress.setStages(1);
    context.progress.beginStage("fly", uint64_t(flight.frames));
    FlightRecord record;
    try {
        record = fly(files.views(), camera_path, flight, [&](int) { context.progress.tick(1); });
    } catch (const MemoryError& error) {
        throw MemoryError(memoryMessage(ram_, renderer_ == "gl" ? vram_ : 0, error));
    } catch (const UsageError& error) {
        throw UsageError(fmt::format("--renderer {}: {}", renderer_, error.what()));
    }
    context.progress.endStage();
    for (const std::string& fault : record.faults) logWarning(fault);
    const Json json = report(record);
    const Json& summary = json["summary"];
    logInfo(fmt::format(
        "{} frames in {:.1f} s; a frame {:.1f} ms (median), {:.1f} ms (99 %); {} triangles/s; "
        "first image after {:.0f} ms, converged {:.0f} ms after the last frame",
        record.frames.size(), record.seconds, summary["ms"]["median"].get<double>(),
        summary["ms"]["p99"].get<double>(),
        formatCount(summary["triangles_per_second"].get<double>()), record.first_image_ms,
        record.converged_ms));
    writeReport(context.common.report, json, context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeBenchVerb() {
    return std::make_unique<BenchVerb>();
}

}  // namespace pietra
