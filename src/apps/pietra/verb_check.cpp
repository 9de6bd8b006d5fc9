// pietra check: does a model keep its promises?

#include <fmt/format.h>

#include <nlohmann/json.hpp>

#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "audit/adaptive_check.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "methods/method_table.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kProgramBytes = size_t(64) << 20;
constexpr size_t kWorkBytes = size_t(64) << 20;

Json toJson(const ModelCheckReport& report) {
    const VerifyReport& file = report.file;
    const CutsReport& cuts = report.cuts;
    const CertificateSummary& certificate = report.certificate;
    Json tightness = Json::array();
    for (const TightnessRow& row : certificate.tightness)
        tightness.push_back({{"height", row.height},
                             {"groups", row.groups},
                             {"least", row.least},
                             {"median", row.median},
                             {"p95", row.p95},
                             {"worst", row.worst}});
    std::vector<std::string> faults = file.faults;
    faults.insert(faults.end(), report.faults.begin(), report.faults.end());
    Json json = {
        {"ok", report.ok()},
        {"pages", {{"checked", file.pages.checked}, {"bad", file.pages.bad}}},
        {"nodes", {{"checked", file.nodes.checked}, {"bad", file.nodes.bad}}},
        {"bounds", {{"checked", file.bounds.checked}, {"not_nested", file.bounds.not_nested}}},
        {"errors", {{"checked", file.errors.checked}, {"not_monotone", file.errors.not_monotone}}},
        {"cones", {{"checked", file.cones.checked}, {"bad", file.cones.bad}}},
        {"cuts",
         {{"checked", cuts.checked},
          {"triangles", cuts.triangles},
          {"invalid", cuts.invalid},
          {"cracked_edges", cuts.cracked_edges},
          {"overlapping_edges", cuts.overlapping_edges},
          {"miscounted_edges", cuts.miscounted_edges},
          {"disagreeing_edges", cuts.disagreeing_edges},
          {"degenerate_triangles", cuts.degenerate_triangles}}},
        {"certificate",
         {{"error_bound_violations", certificate.violations},
          {"samples", certificate.samples},
          {"cuts", certificate.cuts},
          {"worst_ratio", certificate.worst_ratio},
          {"stated_over_measured", tightness}}},
        {"faults", faults}};
    if (report.input)
        json["input"] = {{"triangles", report.input->triangles},
                         {"degenerate", report.input->degenerate},
                         {"duplicate", report.input->duplicate},
                         {"border_edges", report.input->border_edges},
                         {"same_surface", report.input->same_surface},
                         {"same_drops", report.input->same_drops}};
    return json;
}

std::string toText(const ModelCheckReport& report) {
    const VerifyReport& file = report.file;
    const CutsReport& cuts = report.cuts;
    std::string text = fmt::format(
        "pages        {} checked, {} bad\n"
        "nodes        {} checked, {} bad\n"
        "bounds       {} checked, {} not nested\n"
        "errors       {} checked, {} not monotone\n"
        "cones        {} checked, {} bad\n"
        "cuts         {} checked, {} cracked edges, {} overlapping edges, {} other faults\n",
        file.pages.checked, file.pages.bad, file.nodes.checked, file.nodes.bad, file.bounds.checked,
        file.bounds.not_nested, file.errors.checked, file.errors.not_monotone, file.cones.checked,
        file.cones.bad, cuts.checked, cuts.cracked_edges, cuts.overlapping_edges,
        cuts.faults() - cuts.cracked_edges - cuts.overlapping_edges);
    if (report.input)
        text += fmt::format("input        {} triangles, {} border edges; the finest cut is {}\n",
                            report.input->triangles, report.input->border_edges,
                            report.input->ok() ? "just that" : "something else");
    if (report.certificate.cuts > 0)
        text += fmt::format(
            "certificate  {} samples of {} cuts against the {}, {} violations; farthest {:.3f} of "
            "the stated error\n",
            report.certificate.samples, report.certificate.cuts,
            report.certificate.against_input ? "input" : "finest cut",
            report.certificate.violations, report.certificate.worst_ratio);
    return text + (report.ok() ? "ok\n" : "FAULTY\n");
}

class CheckVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    std::string tempDir() const;

    std::string file_;
    uint64_t cuts_ = 8;
    uint64_t seed_ = 1;
    uint64_t samples_ = 250'000;
    std::vector<std::string> input_;
    std::string temp_dir_;
    bool json_ = false;
    Limits limits_;
};

VerbText CheckVerb::text() const {
    return {
        "check",
        "prove that a model is whole, crack-free and true to its errors",
        {"FILE [options]"},
        {"Verifies every page's checksum and content, that bounds are nested and errors monotone; "
         "takes seeded cuts, as any camera or threshold may, and counts their cracks and overlaps "
         "exactly, on the integer lattice; and audits the certificate: samples of the surface must "
         "lie within the stated errors, in both directions.",
         "Without --input the certificate compares all resolutions with the finest; with it, with "
         "the input itself, whose triangles the finest must have, no more and no less, and whose "
         "border every other one must follow.",
         "Exit status 3 says that the file is damaged, 6 that it is intact but breaks a promise."},
        {{"a model alone", "pietra check statue.pietra"},
         {"against its input", "pietra check statue.pietra --input statue.ply --cuts 32"}}};
}

void CheckVerb::declare(OptionSet& options) {
    options.file("FILE", file_, "The model.").require();
    options.count("--cuts", "N", cuts_, {.min = 0, .max = 1'000'000},
                  "How many cuts to test for cracks.");
    options.count("--seed", "S", seed_, {}, "Chooses the cuts and the samples.");
    options.count("--samples", "N", samples_, {.min = 0, .max = 1'000'000'000},
                  "Points of the surface to audit the certificate with; 0 leaves it out.");
    options.texts("--input", "IN", input_, "The mesh files that the model was built from.");
    options.flag("--json", json_, "Print JSON.");
    limits_.declare(options);
    options.text("--temp-dir", "DIR", temp_dir_, "Where temporary files go.")
        .defaultsTo("the model's folder");
}

std::string CheckVerb::tempDir() const {
    if (!temp_dir_.empty()) return temp_dir_;
    const size_t slash = file_.rfind('/');
    return slash == std::string::npos ? "." : file_.substr(0, slash + 1);
}

int CheckVerb::run(const RunContext& context) {
    const ThreadLimit threads(limits_.threads());
    const ModelReader model(file_);
    const size_t taken =
        kProgramBytes + model.nodes().size() * (sizeof(Node) + 64) +
        (model.hasPatches() ? 2 * size_t(limits_.threads()) * largestDecodedPageBytes(model) : 0);
    Budget budget(limits_.memoryBytes(taken + kWorkBytes, "checking this model") - taken);
    const auto adaptive = openAdaptive(model);
    const ModelCheckSettings settings{cuts_, seed_, samples_, input_, tempDir()};
    const ModelCheckReport report =
        adaptive ? checkAdaptive(model, *adaptive, settings, budget, context.progress)
                 : checkModel(model, settings, budget, context.progress);
    for (const std::string& fault : report.file.faults) logWarning(fault);
    for (const std::string& fault : report.faults) logWarning(fault);
    if (json_)
        printJson(toJson(report));
    else
        printOut(toText(report));
    writeReport(context.common.report, toJson(report), context.common.force);
    if (report.file.pages.bad > 0) {
        logError(fmt::format("{}: is damaged: {} of {} pages are bad", file_, report.file.pages.bad,
                             report.file.pages.checked));
        return 3;
    }
    return report.ok() ? 0 : 6;
}

}  // namespace

std::unique_ptr<Verb> makeCheckVerb() {
    return std::make_unique<CheckVerb>();
}

}  // namespace pietra
