// pietra synth: meshes of any size for demonstrations, tests and benchmarks.

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/pietra/json_report.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "base/error.h"
#include "base/text.h"
#include "io/synth.h"

namespace pietra {

namespace {

class SynthVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    SynthRequest request_;
    std::string output_;
};

VerbText SynthVerb::text() const {
    std::vector<std::pair<std::string, std::string>> kinds;
    for (const SynthKind& kind : synthKinds()) kinds.emplace_back(kind.name, kind.about);
    return {
        "synth",
        "make a mesh of any size, for trying things out",
        {"KIND -o OUT.ply [--triangles N] [--seed S]",
         "subdivide IN -o OUT.ply [--levels N] [--displace A] [--seed S]"},
        {"Writes a mesh that is a function of its kind, its size and the seed alone. Memory does "
         "not grow with the size. The ending of the name decides the format: .ply, .obj, .stl or "
         ".glb."},
        {{"a statue of ten million triangles", "pietra synth statue -o big.ply --triangles 10M"},
         {"a scan, made 256 times larger with detail of its own",
          "pietra synth subdivide scan.ply -o huge.ply --levels 4 --displace 0.2"}},
        "Kinds",
        kinds};
}

void SynthVerb::declare(OptionSet& options) {
    options.file("KIND", request_.kind, "What to make.").require();
    options.file("IN", request_.input,
                 "Of `subdivide`: the mesh to refine. Of `earth`: the netCDF file.");
    options.text("-o,--output", "OUT.ply", output_, "The mesh to write.").require();
    options.count("--triangles", "N", request_.triangles, {.min = 0}, "How many triangles, about.")
        .defaultsTo("the kind's own");
    options.count("--seed", "S", request_.seed, {}, "Chooses among shapes of a kind.");
    options.count("--levels", "N", request_.levels, {.min = 0, .max = 20},
                  "Of `subdivide`: each level makes four triangles of one.");
    options.number("--displace", "A", request_.displace, {.min = 0, .max = 1},
                   "Of `subdivide`: height of the detail, as a part of the local edge.");
}

int SynthVerb::run(const RunContext& context) {
    checkOutput(output_, context.common.force);
    context.progress.setStages(1);
    const SynthResult result =
        synthesize(request_, output_, context.common.force, context.progress);
    context.progress.endStage();
    for (const std::string& note : result.notes) logWarning(note);
    logInfo(fmt::format("{}: {} triangles, {} vertices", output_,
                        formatCount(double(result.triangles)),
                        formatCount(double(result.vertices))));
    writeReport(
        context.common.report,
        {{"kind", request_.kind}, {"triangles", result.triangles}, {"vertices", result.vertices}},
        context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeSynthVerb() {
    return std::make_unique<SynthVerb>();
}

}  // namespace pietra
