#include "audit/model_audit.h"

#include <fmt/format.h>

#include <algorithm>

#include "audit/border_chains.h"
#include "audit/input_survey.h"
#include "audit/input_triangles.h"
#include "audit/sample_index.h"
#include "base/hash.h"
#include "multires/cut.h"

namespace pietra {

namespace {

constexpr size_t kEnoughForTables_bytes = size_t(256) << 20;

std::string pointText(uint64_t key) {
    const Vec3i p = latticePoint(key);
    return fmt::format("({}, {}, {})", p.x, p.y, p.z);
}

std::string describe(const CrackReport& report) {
    std::string text;
    const auto add = [&](uint64_t count, const char* what) {
        if (count > 0) text += fmt::format("{}{} {}", text.empty() ? "" : ", ", count, what);
    };
    add(report.cracked_edges, "cracked edges");
    add(report.overlapping_edges, "overlapping edges");
    add(report.miscounted_edges, "miscounted edges");
    add(report.disagreeing_edges, "edges of unequal classes");
    add(report.degenerate_triangles, "degenerate triangles");
    if (report.first_fault)
        text +=
            fmt::format(", the first between lattice points {} and {}",
                        pointText((*report.first_fault)[0]), pointText((*report.first_fault)[1]));
    return text;
}

class Audit {
public:
    Audit(const AuditedModel& model, TriangleSource* source, const AuditOptions& options,
          Budget& budget, Progress& progress)
        : model_(model), source_(source), options_(options), budget_(budget), progress_(progress) {
        stream_ = [this](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
            model_.stream(nodes, [&](NodeIndex node, const Mesh& mesh) {
                visit(node, mesh);
                progress_.tick();
            });
        };
    }

    AuditReport run() {
        checkHierarchy();
        if (report_.forest.bad_links > 0) return std::move(report_);
        checkAllPatches();
        // What follows trusts indices.
        if (report_.patches.malformed > 0) return std::move(report_);
        chooseCuts();
        if (source_) readInput();
        checkCuts();
        if (options_.samples > 0) auditErrors();
        progress_.endStage();
        return std::move(report_);
    }

private:
    void fault(const std::string& text) {
        if (report_.first_fault.empty()) report_.first_fault = text;
    }

    size_t tableBytes() const { return std::min(kEnoughForTables_bytes, budget_.available() / 2); }

    void checkHierarchy() {
        progress_.beginStage("checking the hierarchy", 0);
        report_.forest = checkForest(model_.nodes);
        fault(report_.forest.first_fault);
    }

    void checkAllPatches() {
        progress_.beginStage("checking the patches", model_.nodes.size());
        report_.patches =
            checkPatches(model_.nodes, model_.info.lattice, model_.info.schema, stream_);
        fault(report_.patches.first_fault);
    }

    void chooseCuts() {
        cuts_.push_back(finestCut(model_.nodes));
        cuts_.push_back(rootCut(model_.nodes));
        for (int k = 0; k < options_.cuts; ++k)
            cuts_.push_back(randomCut(model_.nodes, mixBits(options_.seed) + uint64_t(k)));
    }

    std::string nameOf(size_t cut) const {
        if (cut == 0) return "the finest cut";
        if (cut == 1) return "the coarsest cut";
        const size_t seeded = cut - 2;
        if (seeded < size_t(options_.cuts))
            return fmt::format("cut {} of seed {}", seeded, options_.seed);
        return fmt::format("the cut at height {}", seeded - size_t(options_.cuts) + 1);
    }

    void readInput() {
        progress_.beginStage("comparing with the input", 0);
        input_.emplace(*source_, budget_, budget_.available() / 4, options_.temp_dir, &progress_);
        const InputSurvey survey =
            surveyInput(*input_, model_.info.lattice, budget_, tableBytes(), options_.temp_dir);
        InputComparison& compared = report_.input.emplace();
        compared.degenerate = survey.degenerate;
        compared.duplicate = survey.duplicate;
        compared.same_surface = isSameSurface(fingerprintOfCut(stream_, cuts_[0].nodes), survey);
        if (!compared.same_surface) fault("the finest cut is not the input");
        input_triangles_ = survey.surface.triangles;
        chains_.emplace(survey.border, budget_);
    }

    void checkCuts() {
        uint64_t patches = 0;
        for (const Cut& cut : cuts_) patches += cut.nodes.size();
        progress_.beginStage("looking for cracks", patches);
        for (size_t c = 0; c < cuts_.size(); ++c) {
            const std::string invalid = validateCut(model_.nodes, cuts_[c].nodes);
            if (!invalid.empty()) {
                ++report_.cuts.invalid;
                fault(fmt::format("{}: {}", nameOf(c), invalid));
            }
            const CrackReport cracks =
                chains_ ? countCracksWithin(*chains_, stream_, cuts_[c].nodes, budget_,
                                            tableBytes(), options_.temp_dir)
                        : countCracks(stream_, cuts_[c].nodes, budget_, tableBytes(),
                                      options_.temp_dir);
            ++report_.cuts.checked;
            report_.cuts.cracked_edges += cracks.cracked_edges;
            report_.cuts.overlapping_edges += cracks.overlapping_edges;
            report_.cuts.other_edges += cracks.miscounted_edges + cracks.disagreeing_edges;
            report_.cuts.degenerate_triangles += cracks.degenerate_triangles;
            if (!cracks.ok()) fault(fmt::format("{}: {}", nameOf(c), describe(cracks)));
        }
    }

    /// Samples that surely fit, with the vectors they are gathered in.
    uint64_t samplesThatFit() const {
        return std::min<uint64_t>(options_.samples,
                                  budget_.available() / 2 / SampleIndex::kSampleBytes);
    }

    void auditErrors() {
        progress_.beginStage("auditing the errors", 0);
        chains_.reset();
        if (options_.tightness) addCutsByHeight();
        // The finest cut is itself the truth where there is no input.
        const std::span<const Cut> cuts = std::span(cuts_).subspan(input_ ? 0 : 1);
        const Truth truth = input_ ? truthOfInput(*input_, model_.info.lattice, input_triangles_)
                                   : truthOfFinestCut(model_.nodes, stream_);
        report_.certificates =
            auditCertificate(model_.nodes, cuts, stream_, truth,
                             {.seed = options_.seed, .samples = samplesThatFit()}, budget_);
        report_.tightness = tightnessTable(report_.certificates);
        for (size_t k = 0; k < cuts.size(); ++k) {
            const CertificateReport& certificate = report_.certificates[k];
            if (certificate.violations() == 0) continue;
            const Vec3d& p = *certificate.first_violation;
            fault(
                fmt::format("{}: {} of {} samples violate the stated error, the first at lattice "
                            "point ({:.1f}, {:.1f}, {:.1f})",
                            nameOf(k + (input_ ? 0 : 1)), certificate.violations(),
                            certificate.samples(), p.x, p.y, p.z));
        }
    }

    void addCutsByHeight() {
        const std::vector<uint16_t> heights = Forest(model_.nodes).groupHeights();
        const int top = heights.empty() ? 0 : *std::max_element(heights.begin(), heights.end());
        for (int h = 1; h <= top; ++h) cuts_.push_back(cutByHeight(model_.nodes, h));
    }

    const AuditedModel& model_;
    TriangleSource* const source_;
    const AuditOptions& options_;
    Budget& budget_;
    Progress& progress_;
    PatchStream stream_;  // ticks
    std::vector<Cut> cuts_;
    std::optional<InputTriangles> input_;
    uint64_t input_triangles_ = 0;  // without doubles; as counted, not as the file says
    std::optional<BorderChains> chains_;
    AuditReport report_;
};

}  // namespace

uint64_t AuditReport::samples() const {
    uint64_t sum = 0;
    for (const CertificateReport& certificate : certificates) sum += certificate.samples();
    return sum;
}

uint64_t AuditReport::violations() const {
    uint64_t sum = 0;
    for (const CertificateReport& certificate : certificates) sum += certificate.violations();
    return sum;
}

double AuditReport::worstRatio() const {
    double worst = 0;
    for (const CertificateReport& certificate : certificates)
        worst = std::max(worst, certificate.worstRatio());
    return worst;
}

AuditReport auditModel(const AuditedModel& model, TriangleSource* input,
                       const AuditOptions& options, Budget& budget, Progress& progress) {
    return Audit(model, input, options, budget, progress).run();
}

}  // namespace pietra
