#include "audit/model_check.h"

#include <fmt/format.h>

#include <algorithm>

#include "audit/border_chains.h"
#include "audit/cracks.h"
#include "audit/input_survey.h"
#include "multires/forest.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

void add(const CrackReport& cracks, CutsReport& sum) {
    ++sum.checked;
    sum.triangles += cracks.triangles;
    sum.cracked_edges += cracks.cracked_edges;
    sum.overlapping_edges += cracks.overlapping_edges;
    sum.miscounted_edges += cracks.miscounted_edges;
    sum.disagreeing_edges += cracks.disagreeing_edges;
    sum.degenerate_triangles += cracks.degenerate_triangles;
}

class Checker {
public:
    Checker(const ModelReader& model, const ModelCheckSettings& settings, Budget& budget,
            Progress& progress)
        : model_(model), settings_(settings), budget_(budget), progress_(progress) {
        stream_ = [this](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
            visitPatches(model_, nodes, [&](NodeIndex node, const Mesh& mesh) {
                progress_.tick(0);
                visit(node, mesh);
            });
        };
    }

    ModelCheckReport run() {
        progress_.setStages(2 + int(!settings_.input.empty()) + int(settings_.samples > 0));
        progress_.beginStage("pages", model_.pageCount());
        report_.file = verifyModel(model_, progress_);
        if (report_.file.pages.bad + report_.file.nodes.bad == 0) {
            if (!settings_.input.empty()) checkInput();
            checkCuts();
            if (settings_.samples > 0) checkCertificate();
        }
        progress_.endStage();
        return std::move(report_);
    }

private:
    std::string placeOf(const Vec3d& lattice) const {
        const Vec3d p = model_.info().lattice.toInput(lattice);
        return fmt::format("{:.9g} {:.9g} {:.9g}", p.x, p.y, p.z);
    }

    void tell(const std::string& what) {
        report_.faults.push_back(fmt::format("{}: {}", model_.path(), what));
    }

    void checkInput() {
        progress_.beginStage("input", 0);
        source_ = openSource(settings_.input, settings_.temp_dir);
        input_.emplace(*source_, budget_, budget_.available() / 3, settings_.temp_dir);
        survey_ = surveyInput(*input_, model_.info().lattice, budget_, budget_.available() / 2,
                              settings_.temp_dir);
        chains_.emplace(survey_.border, budget_);
        InputReport& found = report_.input.emplace();
        found.triangles = survey_.surface.triangles;
        found.degenerate = survey_.degenerate;
        found.duplicate = survey_.duplicate;
        found.border_edges = survey_.border.size();
        const SurfaceFingerprint finest =
            fingerprintOfCut(stream_, finestCut(model_.nodes()).nodes);
        found.same_surface = isSameSurface(finest, survey_);
        if (!found.same_surface)
            tell(fmt::format("the finest cut, of {} triangles, is not the input, of {}",
                             finest.triangles, found.triangles));
        found.same_drops = model_.info().dropped_degenerate == found.degenerate &&
                           model_.info().dropped_duplicate == found.duplicate;
        if (!found.same_drops)
            tell(
                fmt::format("{} degenerate and {} duplicate triangles of the input should have "
                            "been dropped, not {} and {}",
                            found.degenerate, found.duplicate, model_.info().dropped_degenerate,
                            model_.info().dropped_duplicate));
    }

    CrackReport cracksOf(const Cut& cut) {
        // What is left serves for the border edges of the cut.
        const size_t memory = budget_.available() / 2;
        return chains_ ? countCracksWithin(*chains_, stream_, cut.nodes, budget_, memory,
                                           settings_.temp_dir)
                       : countCracks(stream_, cut.nodes, budget_, memory, settings_.temp_dir);
    }

    void checkCuts() {
        progress_.beginStage("cuts", settings_.cuts);
        for (uint64_t i = 0; i < settings_.cuts; ++i) {
            const Cut cut = randomCut(model_.nodes(), settings_.seed + i);
            const std::string fault = validateCut(model_.nodes(), cut.nodes);
            if (!fault.empty()) {
                ++report_.cuts.invalid;
                tell(fmt::format("cut {}: {}", i, fault));
            }
            const CrackReport cracks = cracksOf(cut);
            add(cracks, report_.cuts);
            if (!cracks.ok() && cracks.first_fault)
                tell(fmt::format("cut {}: a faulty edge at {}", i,
                                 placeOf(Vec3d(latticePoint((*cracks.first_fault)[0])))));
            progress_.tick();
        }
    }

    /// One cut a height, so that every node is audited once. Against the finest cut, that cut
    /// itself has nothing to show.
    std::vector<Cut> cutsOfAllHeights() const {
        const std::vector<uint16_t> heights = Forest(model_.nodes()).groupHeights();
        const int top = heights.empty() ? -1 : *std::max_element(heights.begin(), heights.end());
        std::vector<Cut> cuts;
        for (int height = input_ ? 0 : 1; height <= top; ++height)
            cuts.push_back(cutByHeight(model_.nodes(), height));
        return cuts;
    }

    void checkCertificate() {
        progress_.beginStage("certificate", 0);
        const std::vector<Cut> cuts = cutsOfAllHeights();
        if (cuts.empty()) return;
        CertificateOptions options;
        options.seed = settings_.seed;
        // An index takes some 128 bytes a sample; twice that leaves room for gathering them.
        options.samples = std::min<uint64_t>(settings_.samples, budget_.available() / 2 / 256);
        const Truth truth =
            input_ ? truthOfInput(*input_, model_.info().lattice, model_.info().input_triangles)
                   : truthOfFinestCut(model_.nodes(), stream_);
        const std::vector<CertificateReport> reports =
            auditCertificate(model_.nodes(), cuts, stream_, truth, options, budget_);
        CertificateSummary& sum = report_.certificate;
        sum.against_input = bool(input_);
        sum.cuts = cuts.size();
        for (const CertificateReport& report : reports) {
            sum.samples += report.samples();
            sum.violations += report.violations();
            sum.worst_ratio = std::max(sum.worst_ratio, report.worstRatio());
            if (report.first_violation)
                tell("beyond the stated error at " + placeOf(*report.first_violation));
        }
        sum.tightness = tightnessTable(reports);
    }

    const ModelReader& model_;
    const ModelCheckSettings& settings_;
    Budget& budget_;
    Progress& progress_;
    PatchStream stream_;
    std::unique_ptr<TriangleSource> source_;
    std::optional<InputTriangles> input_;
    InputSurvey survey_;
    std::optional<BorderChains> chains_;
    ModelCheckReport report_;
};

}  // namespace

ModelCheckReport checkModel(const ModelReader& model, const ModelCheckSettings& settings,
                            Budget& budget, Progress& progress) {
    return Checker(model, settings, budget, progress).run();
}

}  // namespace pietra
