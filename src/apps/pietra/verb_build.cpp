// pietra build: meshes in, a model out.

#include <fmt/format.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <nlohmann/json.hpp>

#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/stopwatch.h"
#include "base/text.h"
#include "io/triangle_source.h"
#include "methods/method_table.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kLeastMemory = size_t(128) << 20;

bool sameFile(const std::string& a, const std::string& b) {
    struct stat first {
    }, second{};
    return ::stat(a.c_str(), &first) == 0 && ::stat(b.c_str(), &second) == 0 &&
           first.st_dev == second.st_dev && first.st_ino == second.st_ino;
}

/// Empty if there is no saying whether they will be the same next time.
std::string identityOf(const std::vector<std::string>& inputs) {
    std::string identity;
    for (const std::string& input : inputs) {
        struct stat info {};
        if (::stat(input.c_str(), &info) != 0 || !S_ISREG(info.st_mode)) return "";
        identity += fmt::format("{} {} {} {}.{}\n", info.st_dev, info.st_ino, info.st_size,
                                info.st_mtim.tv_sec, info.st_mtim.tv_nsec);
    }
    return identity;
}

std::string folderOf(const std::string& path) {
    const size_t slash = path.rfind('/');
    return slash == std::string::npos ? "." : path.substr(0, slash + 1);
}

void checkFolder(const std::string& path) {
    struct stat info {};
    if (::stat(path.c_str(), &info) != 0) throw IoError(path, "use as --temp-dir", errno);
    if (!S_ISDIR(info.st_mode)) throw IoError(path, "use as --temp-dir", ENOTDIR);
    if (::access(path.c_str(), W_OK | X_OK) != 0) throw IoError(path, "use as --temp-dir", errno);
}

PrecisionSetting parsePrecision(const std::string& word) {
    if (word == "auto") return {PrecisionSetting::Kind::kAuto, 0};
    if (word == "finest") return {PrecisionSetting::Kind::kFinest, 0};
    try {
        return {PrecisionSetting::Kind::kStep, parseNumber(word, {.min = 0, .above = true})};
    } catch (const UsageError&) {
        throw UsageError(fmt::format("'{}' is neither auto nor finest nor a number above 0", word));
    }
}

class BuildVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    BuildSettings settings(const RunContext& context) const;
    std::string inputName() const;
    int dryRun(TriangleSource& source, const BuildSettings& settings) const;
    Json report(const BuildReport& result, const BuildSettings& settings, uint64_t input_bytes,
                double seconds, const Progress& progress) const;
    void summarise(const BuildReport& result, double seconds) const;

    std::vector<std::string> inputs_;
    std::string output_;
    std::string method_ = methods().front().name;
    Limits limits_;
    std::string temp_dir_;
    PrecisionSetting precision_;
    uint64_t leaf_triangles_ = BuildSettings().leaf_triangles;
    uint64_t patch_triangles_ = BuildSettings().patch_triangles;
    bool resume_ = false;
    double checkpoint_seconds_ = BuildSettings().checkpoint_seconds;
    bool dry_run_ = false;
};

VerbText BuildVerb::text() const {
    return {
        "build",
        "make a model from one or more meshes",
        {"IN... -o OUT.pietra [options]"},
        {"Reads triangle meshes, several as one, and writes the multiresolution model that all "
         "other verbs take. The memory it needs does not grow with the mesh; what does not fit "
         "goes "
         "to temporary files, some 60 to 100 bytes a triangle. The output appears under its name "
         "only when it is complete.",
         "Formats are told by content: PLY, OBJ, STL, glTF and GLB, packed by gzip, xz or zstd "
         "too. A pipe (/dev/stdin) is copied to a temporary file first. Normals, colours and "
         "scalar attributes are kept.",
         "The bytes of the model depend on the bytes of the input, the method, the precision and "
         "the patch sizes alone: not on memory, threads or names."},
        {{"a model of a scan", "pietra build statue.ply -o statue.pietra"},
         {"from several files, in a gigabyte of memory",
          "pietra build part1.ply part2.ply -o all.pietra --memory 1G"},
         {"what would be read, without building",
          "pietra build statue.ply -o x.pietra --dry-run"}}};
}

void BuildVerb::declare(OptionSet& options) {
    options.files("IN", inputs_, "Mesh files.").require();
    options.text("-o,--output", "OUT.pietra", output_, "The model to write.").require();
    std::vector<std::string> names;
    for (const Method& method : methods()) names.push_back(method.name);
    options.choice("--method", method_, names, "How the model is made.");
    limits_.declare(options);
    options
        .text("--temp-dir", "DIR", temp_dir_,
              "Where temporary files go; they vanish with the process, but for what an interrupted "
              "build leaves for --resume.")
        .defaultsTo("the output's folder");
    options.flag("--resume", resume_,
                 "Go on with an interrupted build of the same input and settings; with nothing to "
                 "go on with, starts afresh.");
    options.number("--checkpoint", "SECONDS", checkpoint_seconds_, {.min = 0},
                   "Of work that an interruption may cost, about: less is not kept.");
    options.custom("--precision", "auto|finest|STEP", "auto",
                   "Spacing of the lattice onto which vertices move: the coarsest that keeps the "
                   "error below 1/50 of the median edge (auto), the finest, of 21 bits an axis, or "
                   "a step in the input's units.",
                   [this](const std::string& word) { precision_ = parsePrecision(word); });
    options.count("--leaf-triangles", "N", leaf_triangles_, {.min = 100, .max = 50'000},
                  "Most triangles of a patch of the input's own resolution.");
    options.count("--patch-triangles", "N", patch_triangles_, {.min = 100, .max = 50'000},
                  "Triangles of a coarser patch, about.");
    options.flag("--dry-run", dry_run_,
                 "Only read the input once, and print what would be built; nothing is written.");
}

std::string BuildVerb::inputName() const {
    return inputs_.size() == 1 ? inputs_[0]
                               : fmt::format("{} and {} more", inputs_[0], inputs_.size() - 1);
}

BuildSettings BuildVerb::settings(const RunContext& context) const {
    BuildSettings settings;
    settings.output = output_;
    settings.force = context.common.force;
    settings.memory_bytes = limits_.memoryBytes(kLeastMemory, "building");
    settings.jobs = limits_.threads();
    settings.temp_dir = temp_dir_.empty() ? folderOf(output_) : temp_dir_;
    settings.precision = precision_;
    settings.leaf_triangles = uint32_t(leaf_triangles_);
    settings.patch_triangles = uint32_t(patch_triangles_);
    settings.input_name = inputName();
    settings.input_files = uint32_t(inputs_.size());
    settings.input_identity = identityOf(inputs_);
    settings.resume = resume_;
    settings.checkpoint_seconds = checkpoint_seconds_;
    for (const std::string& input : inputs_)
        if (sameFile(input, output_))
            throw UsageError(fmt::format("{}: is an input and the output", output_));
    if (!dry_run_) {
        checkOutput(output_, context.common.force);
        checkFolder(settings.temp_dir);
    }
    return settings;
}

int BuildVerb::dryRun(TriangleSource& source, const BuildSettings& settings) const {
    uint64_t triangles = 0;
    TriangleBatch batch;
    source.rewindTriangles();
    while (source.readTriangles(batch)) triangles += batch.triangle.size();
    const AttributeSchema& schema = source.schema();
    std::string attributes = schema.normals_given ? "normals" : "normals (to be computed)";
    if (schema.colours) attributes += ", colours";
    for (const std::string& name : schema.scalars) attributes += ", " + name;
    printOut(
        fmt::format("input        {}, {}\n"
                    "triangles    {}\n"
                    "vertices     {}\n"
                    "attributes   {}\n"
                    "method       {}\n"
                    "memory       {}\n"
                    "threads      {}\n"
                    "output       {}\n"
                    "temporary    {}\n",
                    settings.input_name, formatBytes(source.inputBytes()), triangles,
                    source.vertexCount(), attributes, method_, formatBytes(settings.memory_bytes),
                    settings.jobs, output_, settings.temp_dir));
    for (const std::string& note : source.notes()) logWarning(note);
    return 0;
}

Json BuildVerb::report(const BuildReport& result, const BuildSettings& settings,
                       uint64_t input_bytes, double seconds, const Progress& progress) const {
    Json times{{"total", seconds}};
    for (auto [name, stage_seconds] : progress.stageSeconds()) {
        std::replace(name.begin(), name.end(), ' ', '_');
        times[name] = times.value(name, 0.0) + stage_seconds;
    }
    return {{"method", method_},
            {"input",
             {{"triangles", result.input_triangles},
              {"vertices", result.input_vertices},
              {"bytes", input_bytes},
              {"files", inputs_.size()},
              {"border_edges", result.border_edges},
              {"non_manifold_edges", result.non_manifold_edges},
              {"inconsistent_edges", result.inconsistent_edges}}},
            {"seconds", times},
            {"triangles_per_second", double(result.input_triangles) / seconds},
            {"peak_rss_bytes", peakResidentBytes()},
            {"memory_limit_bytes", settings.memory_bytes},
            {"temp_bytes_peak", result.temp_bytes_peak},
            {"output_bytes", result.output_bytes},
            {"jobs", settings.jobs},
            {"ranks", 1},
            {"dropped",
             {{"degenerate", result.dropped_degenerate}, {"duplicate", result.dropped_duplicate}}},
            {"resumed", result.resumed},
            {"nodes", result.nodes},
            {"levels", result.levels},
            {"notes", result.notes}};
}

void BuildVerb::summarise(const BuildReport& result, double seconds) const {
    for (const std::string& note : result.notes) logWarning(note);
    if (result.dropped_degenerate + result.dropped_duplicate > 0)
        logInfo(fmt::format("{} degenerate and {} duplicate triangles were left out",
                            result.dropped_degenerate, result.dropped_duplicate));
    logInfo(fmt::format(
        "{}: {} triangles in {} ({}/s), {}, {:.2f} bytes a triangle, peak memory {}", output_,
        formatCount(double(result.input_triangles)), formatSeconds(seconds),
        formatCount(double(result.input_triangles) / seconds), formatBytes(result.output_bytes),
        double(result.output_bytes) / double(std::max<uint64_t>(result.input_triangles, 1)),
        formatBytes(peakResidentBytes())));
}

int BuildVerb::run(const RunContext& context) {
    const Stopwatch watch;
    const BuildSettings build_settings = settings(context);
    const auto source = openSource(inputs_, build_settings.temp_dir);
    if (dry_run_) return dryRun(*source, build_settings);
    const BuildReport result =
        findMethod(method_)->build(*source, build_settings, context.progress);
    const double seconds = watch.seconds();
    summarise(result, seconds);
    writeReport(context.common.report,
                report(result, build_settings, source->inputBytes(), seconds, context.progress),
                context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeBuildVerb() {
    return std::make_unique<BuildVerb>();
}

}  // namespace pietra
