// pietra synth: meshes of any size from nothing, or from a small one.

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "apps/pietra/json_report.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "base/error.h"
#include "base/text.h"
#include "io/subdivide.h"
#include "io/synth.h"

namespace pietra {

namespace {

class SynthVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    SynthRequest request() const;

    std::string kind_, input_, output_;
    std::optional<uint64_t> triangles_;
    uint64_t seed_ = SynthRequest{}.seed;
    std::optional<uint64_t> levels_;
    std::optional<double> displace_;
};

VerbText SynthVerb::text() const {
    std::vector<std::pair<std::string, std::string>> kinds;
    for (const SynthKind& kind : synthKinds()) kinds.emplace_back(kind.name, kind.about);
    return {
        "synth",
        "make a mesh to try things with",
        {"KIND -o OUT.ply [--triangles N] [--seed S]",
         "subdivide IN -o OUT.ply [--levels N] [--displace A] [--seed S]"},
        {"Writes a generated mesh of any size, in bounded memory: the same bytes for the same "
         "options on every machine. The ending of the name decides the format: .ply, .obj, .stl "
         "or .glb.",
         "Subdivision turns a scan into one 4^N times as large. Each level displaces its new "
         "vertices at random by up to --displace of the local edge, so that the large mesh is as "
         "rough as real scans are; a closed mesh stays closed."},
        {{"ten million triangles of a statue", "pietra synth statue -o statue.ply --triangles 10M"},
         {"a dragon of 223 million triangles",
          "pietra synth subdivide dragon.ply -o dragon4.ply --levels 4 --displace 0.2"}},
        "Kinds",
        kinds};
}

void SynthVerb::declare(OptionSet& options) {
    std::string kinds;
    for (const SynthKind& kind : synthKinds())
        kinds += (kinds.empty() ? "" : ", ") + std::string(kind.name);
    options.file("KIND", kind_, "What to make.").require();
    options.file(
        "IN", input_,
        "The mesh to subdivide; of earth, a netCDF file of heights, if not the usual one.");
    options.text("-o,--output", "OUT.ply", output_, "The mesh to write.").require();
    options.count("--triangles", "N", triangles_, {.min = 1}, "About how many triangles.")
        .defaultsTo("2M; of earth, all that there are");
    options.count("--seed", "S", seed_, {}, "Chooses what is random.");
    options
        .count("--levels", "N", levels_, {.max = kMaxSubdivideLevels},
               "How often each triangle is cut into four.")
        .defaultsTo(std::to_string(SynthRequest{}.levels));
    options
        .number("--displace", "A", displace_, {.min = 0, .max = 1},
                "How far new vertices are displaced, in parts of the local edge.")
        .defaultsTo(fmt::format("{}", SynthRequest{}.displace));
}

SynthRequest SynthVerb::request() const {
    const bool subdivides = kind_ == "subdivide";
    if (subdivides && triangles_)
        throw UsageError("--triangles: synth subdivide is told --levels instead");
    if (!subdivides && levels_) throw UsageError("--levels: goes with synth subdivide only");
    if (!subdivides && displace_) throw UsageError("--displace: goes with synth subdivide only");
    if (!input_.empty() && !subdivides && kind_ != "earth")
        throw UsageError(fmt::format("synth {} takes no input, '{}' was given", kind_, input_));
    SynthRequest request;
    request.kind = kind_;
    request.triangles = triangles_.value_or(0);
    request.seed = seed_;
    request.input = input_;
    if (levels_) request.levels = int(*levels_);
    request.displace = displace_.value_or(request.displace);
    return request;
}

int SynthVerb::run(const RunContext& context) {
    checkOutput(output_, context.common.force);
    context.progress.setStages(1);
    const SynthResult result =
        synthesize(request(), output_, context.common.force, context.progress);
    for (const std::string& note : result.notes) logWarning(note);
    logInfo(
        fmt::format("{}: {} triangles, {} vertices", output_, result.triangles, result.vertices));
    writeReport(context.common.report,
                {{"kind", kind_}, {"triangles", result.triangles}, {"vertices", result.vertices}},
                context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeSynthVerb() {
    return std::make_unique<SynthVerb>();
}

}  // namespace pietra
