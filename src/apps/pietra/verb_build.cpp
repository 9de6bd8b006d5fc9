// `pietra build`: from mesh files to a model.

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include <chrono>
#include <thread>

#include "apps/pietra/json_report.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/text.h"
#include "methods/method_table.h"

namespace pietra {
namespace {

PrecisionSetting parsePrecision(const std::string& text) {
    if (text == "auto") return {PrecisionSetting::Kind::kAuto, 0};
    if (text == "finest") return {PrecisionSetting::Kind::kFinest, 0};
    try {
        return {PrecisionSetting::Kind::kStep, parseNumber(text, {.min = 0, .above = true})};
    } catch (const UsageError&) {
        throw UsageError(fmt::format(
            "--precision {}: is \"auto\", \"finest\" or a positive number, as in 0.001", text));
    }
}

std::string directoryOf(const std::string& path) {
    const size_t slash = path.rfind('/');
    return slash == std::string::npos ? "." : path.substr(0, slash + 1);
}

class BuildVerb : public Verb {
public:
    VerbText text() const override {
        return {
            "build",
            "make a multiresolution model from mesh files",
            {"IN... -o OUT.pietra [options]"},
            {"Reads one or several mesh files as one model and writes a .pietra file, from which the "
             "mesh can be looked at, extracted and checked at any resolution. Every resolution "
             "carries a proven bound of its distance to the input.",
             "Works in the memory given, however large the mesh is; what does not fit waits in "
             "temporary files. The file written does not depend on --jobs, --memory or the machine."},
            {{"Build with all defaults", "pietra build statue.ply -o statue.pietra"},
             {"A billion triangles in 512 MiB", "pietra build big.ply -o big.pietra --memory 512M "
                                                "--temp-dir /scratch"}},
        };
    }

    void declare(OptionSet& options) override {
        options.files("IN", inputs_, "mesh files; several are one model").require();
        options.text("-o,--output", "OUT.pietra", output_, "the model to write").require();
        std::vector<std::string> names;
        for (const Method& m : methods()) names.emplace_back(m.name);
        options.choice("--method", method_, names, "how the model is organised");
        options.size("--memory", memory_, "bound of the process's resident memory")
            .defaultsTo("half of the machine's");
        options.count("--jobs", "N", jobs_, {.min = 1, .max = 1024}, "threads")
            .defaultsTo("all processors");
        options.text("--temp-dir", "DIR", temp_dir_, "where temporary files go")
            .defaultsTo("the folder of the output");
        options.flag("--resume", resume_, "go on with an interrupted build");
        options.text("--precision", "P", precision_,
                     "how fine positions are kept: auto (error below 1/50 of the median edge), "
                     "finest (21 bits an axis), or a step in the input's units");
        options.count("--leaf-triangles", "N", leaf_triangles_, {.min = 64, .max = 1 << 20},
                      "most triangles of a patch at full resolution");
        options.count("--patch-triangles", "N", patch_triangles_, {.min = 64, .max = 1 << 20},
                      "about how many triangles coarser patches have");
        options.flag("--dry-run", dry_run_, "only read the inputs' headers and say what they hold");
    }

    int run(const RunContext& context) override {
        if (resume_)
            throw UsageError("--resume: resuming is not available yet: start again without it");
        BuildSettings settings;
        settings.precision = parsePrecision(precision_);
        const Method* method = findMethod(method_);
        const std::unique_ptr<TriangleSource> source = openSource(inputs_);
        if (dry_run_) return dryRun(*source);
        checkOutput(output_, context.common.force);
        settings.output = output_;
        settings.force = context.common.force;
        settings.memory_bytes = memory_ ? size_t(*memory_) : machineMemoryBytes() / 2;
        settings.jobs = int(jobs_ ? *jobs_ : std::max(1u, std::thread::hardware_concurrency()));
        settings.temp_dir = temp_dir_.empty() ? directoryOf(output_) : temp_dir_;
        settings.leaf_triangles = leaf_triangles_;
        settings.patch_triangles = patch_triangles_;
        settings.input_name = inputs_[0];
        settings.input_files = uint32_t(inputs_.size());
        const auto began = std::chrono::steady_clock::now();
        const BuildReport report = method->build(*source, settings, context.progress);
        const std::chrono::duration<double> seconds = std::chrono::steady_clock::now() - began;
        for (const std::string& note : report.notes) logInfo(note);
        logInfo(fmt::format(
            "{}: {} triangles in {} ({} triangles/s), {} on disk ({:.2f} bytes a triangle), peak "
            "memory {}",
            output_, formatCount(double(report.input_triangles)), formatSeconds(seconds.count()),
            formatCount(double(report.input_triangles) / seconds.count()),
            formatBytes(report.output_bytes),
            double(report.output_bytes) / double(std::max<uint64_t>(report.input_triangles, 1)),
            formatBytes(peakResidentBytes())));
        writeReport(context.common.report,
                    reportJson(settings, report, *source, seconds.count(), context.progress),
                    context.common.force);
        return 0;
    }

private:
    int dryRun(TriangleSource& source) const {
        printOut(fmt::format("{}: {} vertices, {} triangles, {}\n", inputs_[0],
                             source.vertexCount(), source.triangleCountHint(),
                             formatBytes(source.inputBytes())));
        return 0;
    }

    nlohmann::ordered_json reportJson(const BuildSettings& settings, const BuildReport& report,
                                      const TriangleSource& source, double seconds,
                                      const Progress& progress) const {
        nlohmann::ordered_json json;
        json["method"] = method_;
        json["input"] = {{"triangles", report.input_triangles},
                         {"vertices", report.input_vertices},
                         {"bytes", source.inputBytes()},
                         {"border_edges", report.border_edges},
                         {"non_manifold_edges", report.non_manifold_edges},
                         {"inconsistent_edges", report.inconsistent_edges}};
        json["seconds"]["total"] = seconds;
        for (const auto& [stage, stage_seconds] : progress.stageSeconds())
            json["seconds"][stage] = stage_seconds;
        json["triangles_per_second"] = double(report.input_triangles) / seconds;
        json["peak_rss_bytes"] = peakResidentBytes();
        json["memory_limit_bytes"] = settings.memory_bytes;
        json["temp_bytes_peak"] = report.temp_bytes_peak;
        json["output_bytes"] = report.output_bytes;
        json["levels"] = report.levels;
        json["nodes"] = report.nodes;
        json["jobs"] = settings.jobs;
        json["ranks"] = 1;
        json["dropped"] = {{"degenerate", report.dropped_degenerate},
                           {"duplicate", report.dropped_duplicate}};
        json["resumed"] = false;
        json["notes"] = report.notes;
        return json;
    }

    std::vector<std::string> inputs_;
    std::string output_, temp_dir_, method_ = methods()[0].name, precision_ = "auto";
    std::optional<uint64_t> memory_, jobs_;
    uint32_t leaf_triangles_ = 4000, patch_triangles_ = 2000;
    bool resume_ = false, dry_run_ = false;
};

}  // namespace

std::unique_ptr<Verb> makeBuildVerb() { return std::make_unique<BuildVerb>(); }

}  // namespace pietra
