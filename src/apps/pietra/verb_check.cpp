// pietra check: does a model keep its promises?

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "audit/certificate.h"
#include "audit/cracks.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "multires/forest.h"
#include "runtime/patch_reader.h"
#include "store/verify.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

constexpr size_t kProgramBytes = size_t(64) << 20;
constexpr size_t kWorkBytes = size_t(64) << 20;

/// Sums over all cuts.
struct CutsReport {
    uint64_t checked = 0, triangles = 0;
    uint64_t invalid = 0;  ///< no valid cut at all
    uint64_t cracked_edges = 0, overlapping_edges = 0;
    uint64_t miscounted_edges = 0, disagreeing_edges = 0, degenerate_triangles = 0;
    uint64_t faults() const {
        return invalid + cracked_edges + overlapping_edges + miscounted_edges + disagreeing_edges +
               degenerate_triangles;
    }
};

struct CertificateSummary {
    bool done = false;
    uint64_t cuts = 0, samples = 0, violations = 0;
    double worst_ratio = 0;
    std::vector<TightnessRow> tightness;
};

struct CheckReport {
    VerifyReport file;
    CutsReport cuts;
    CertificateSummary certificate;
    bool ok() const { return file.ok() && cuts.faults() == 0 && certificate.violations == 0; }
};

Json toJson(const CheckReport& report) {
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
    return {
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
        {"faults", file.faults}};
}

std::string toText(const CheckReport& report, bool with_input) {
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
    if (report.certificate.done)
        text += fmt::format(
            "certificate  {} samples of {} cuts against the {}, {} violations; farthest {:.3f} of "
            "the stated error\n",
            report.certificate.samples, report.certificate.cuts,
            with_input ? "input" : "finest cut", report.certificate.violations,
            report.certificate.worst_ratio);
    return text + (report.ok() ? "ok\n" : "FAULTY\n");
}

class CheckVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    CutsReport checkCuts(const ModelReader& model, const PatchStream& stream, Budget& budget,
                         Progress& progress) const;
    CertificateSummary audit(const ModelReader& model, const PatchStream& stream, Budget& budget,
                             Progress& progress) const;
    std::vector<CertificateReport> auditCuts(const ModelReader& model, std::span<const Cut> cuts,
                                             const PatchStream& stream, Budget& budget) const;
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
         "the input itself.",
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

CutsReport CheckVerb::checkCuts(const ModelReader& model, const PatchStream& stream, Budget& budget,
                                Progress& progress) const {
    CutsReport sum;
    progress.beginStage("cuts", cuts_);
    for (uint64_t i = 0; i < cuts_; ++i) {
        const Cut cut = randomCut(model.nodes(), seed_ + i);
        const std::string fault = validateCut(model.nodes(), cut.nodes);
        if (!fault.empty()) {
            ++sum.invalid;
            logWarning(fmt::format("{}: cut {}: {}", file_, i, fault));
        }
        const CrackReport cracks =
            countCracks(stream, cut.nodes, budget, budget.available() / 2, tempDir());
        ++sum.checked;
        sum.triangles += cracks.triangles;
        sum.cracked_edges += cracks.cracked_edges;
        sum.overlapping_edges += cracks.overlapping_edges;
        sum.miscounted_edges += cracks.miscounted_edges;
        sum.disagreeing_edges += cracks.disagreeing_edges;
        sum.degenerate_triangles += cracks.degenerate_triangles;
        if (!cracks.ok() && cracks.first_fault) {
            const Vec3d a = model.info().lattice.toInput(latticePoint((*cracks.first_fault)[0]));
            logWarning(fmt::format("{}: cut {}: a faulty edge at {:.9g} {:.9g} {:.9g}", file_, i,
                                   a.x, a.y, a.z));
        }
        progress.tick();
    }
    progress.endStage();
    return sum;
}

std::vector<CertificateReport> CheckVerb::auditCuts(const ModelReader& model,
                                                    std::span<const Cut> cuts,
                                                    const PatchStream& stream,
                                                    Budget& budget) const {
    CertificateOptions options;
    options.seed = seed_;
    options.samples = std::min<uint64_t>(samples_, budget.available() / 2 / 256);
    if (input_.empty())
        return auditCertificate(model.nodes(), cuts, stream,
                                truthOfFinestCut(model.nodes(), stream), options, budget);
    const auto source = openSource(input_);
    InputTriangles input(*source, budget, budget.available() / 3, tempDir());
    return auditCertificate(model.nodes(), cuts, stream,
                            truthOfInput(input, model.info().lattice, model.info().input_triangles),
                            options, budget);
}

/// One cut a height, so that every node is audited once.
CertificateSummary CheckVerb::audit(const ModelReader& model, const PatchStream& stream,
                                    Budget& budget, Progress& progress) const {
    CertificateSummary summary;
    if (samples_ == 0) return summary;
    const std::vector<uint16_t> heights = Forest(model.nodes()).groupHeights();
    const int top = heights.empty() ? 0 : *std::max_element(heights.begin(), heights.end());
    std::vector<Cut> cuts;
    for (int height = input_.empty() ? 1 : 0; height <= top; ++height)
        cuts.push_back(cutByHeight(model.nodes(), height));
    progress.beginStage("certificate", 0);
    if (cuts.empty()) return summary;  // one resolution only, nothing to compare it with
    const auto reports = auditCuts(model, cuts, stream, budget);
    summary.done = true;
    summary.cuts = cuts.size();
    for (const CertificateReport& report : reports) {
        summary.samples += report.samples();
        summary.violations += report.violations();
        summary.worst_ratio = std::max(summary.worst_ratio, report.worstRatio());
        if (report.first_violation) {
            const Vec3d p = model.info().lattice.toInput(*report.first_violation);
            logWarning(fmt::format("{}: beyond the stated error at {:.9g} {:.9g} {:.9g}", file_,
                                   p.x, p.y, p.z));
        }
    }
    summary.tightness = tightnessTable(reports);
    progress.endStage();
    return summary;
}

int CheckVerb::run(const RunContext& context) {
    const ThreadLimit threads(limits_.threads());
    const ModelReader model(file_);
    const size_t taken = kProgramBytes + model.nodes().size() * (sizeof(Node) + 64) +
                         2 * size_t(limits_.threads()) * largestDecodedPageBytes(model);
    Budget budget(limits_.memoryBytes(taken + kWorkBytes, "checking this model") - taken);
    const PatchStream stream = [&](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
        visitPatches(model, nodes, [&](NodeIndex node, const Mesh& mesh) {
            context.progress.tick(0);
            visit(node, mesh);
        });
    };

    CheckReport report;
    context.progress.setStages(samples_ > 0 ? 3 : 2);
    context.progress.beginStage("pages", model.pageCount());
    report.file = verifyModel(model, context.progress);
    context.progress.endStage();
    for (const std::string& fault : report.file.faults) logWarning(fault);
    if (report.file.pages.bad + report.file.nodes.bad == 0) {
        report.cuts = checkCuts(model, stream, budget, context.progress);
        report.certificate = audit(model, stream, budget, context.progress);
    }
    if (json_)
        printJson(toJson(report));
    else
        printOut(toText(report, !input_.empty()));
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
