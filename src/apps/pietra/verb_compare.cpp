// pietra compare: how much two pictures of one view differ.

#include <fmt/format.h>

#include <nlohmann/json.hpp>
#include <optional>

#include "apps/pietra/json_report.h"
#include "apps/pietra/verbs.h"
#include "audit/picture_compare.h"
#include "base/error.h"
#include "render/picture.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

Json spreadJson(const Spread& spread) {
    return {
        {"pixels", spread.count}, {"mean", spread.mean}, {"p99", spread.p99}, {"max", spread.max}};
}

std::string spreadText(const char* name, const Spread& spread, const char* unit) {
    return fmt::format("{:<12} mean {:.3f}, p99 {:.3f}, max {:.3f} {}, of {} pixels\n", name,
                       spread.mean, spread.p99, spread.max, unit, spread.count);
}

class CompareVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    bool withinLimits(const PictureDifference& difference) const;
    Json json(const PictureDifference& difference) const;
    std::string plain(const PictureDifference& difference) const;

    std::string a_, b_;
    int supersampled_ = 1;
    std::optional<double> max_px_, max_shade_;
    bool json_ = false;
};

VerbText CompareVerb::text() const {
    return {
        "compare",
        "measure how much two pictures of one view differ",
        {"A.png B.png [--max-px X] [--max-shade Y] [--supersampled N] [--json]"},
        {"Compares what two pictures cover, where their depth edges lie, how far their surfaces "
         "are apart (in pixels of displacement), and their shades (of 255). Distances need the "
         "depth that `pietra render` writes into its pictures; other PNG files are compared by "
         "shade alone.",
         "Slits at most a pixel wide that one picture shows closed are counted as hairlines, and "
         "not compared: where parts touch without being joined, they open and close although no "
         "part is displaced by more than the tolerance.",
         "With limits, exit status 6 says that a limit is exceeded."},
        {{"is the picture within a pixel of the full mesh's?",
          "pietra compare one-px.png full.png --max-px 2"}}};
}

void CompareVerb::declare(OptionSet& options) {
    options.file("A", a_, "A picture.").require();
    options.file("B", b_, "Another one, of the same size.").require();
    options.number("--max-px", "X", max_px_, {.min = 0},
                   "Most pixels that coverage, a depth edge or a surface may be displaced by.");
    options.number("--max-shade", "Y", max_shade_, {.min = 0, .max = 255},
                   "Most that the 99th percentile of the shades' differences may be.");
    options.number("--supersampled", "N", supersampled_, {.min = 1, .max = 64},
                   "Count distances in pixels of N by N of these pictures'.");
    options.flag("--json", json_, "Print JSON.");
}

bool CompareVerb::withinLimits(const PictureDifference& difference) const {
    return !(max_px_ && difference.largestPx() > *max_px_) &&
           !(max_shade_ && difference.shade.p99 > *max_shade_);
}

Json CompareVerb::json(const PictureDifference& difference) const {
    Json result{{"ok", withinLimits(difference)},
                {"pixels", difference.pixels},
                {"has_depth", difference.has_depth},
                {"shade", spreadJson(difference.shade)}};
    if (!difference.has_depth) return result;
    result["covered"] = {{"a", difference.covered_a}, {"b", difference.covered_b}};
    result["coverage"] = {{"only_a", difference.only_a}, {"only_b", difference.only_b}};
    result["coverage_px"] = spreadJson(difference.coverage_px);
    result["hairlines"] = {{"only_a", difference.hairline_a}, {"only_b", difference.hairline_b}};
    result["edge_px"] = spreadJson(difference.edge_px);
    result["depth_px"] = spreadJson(difference.depth_px);
    result["largest_px"] = difference.largestPx();
    return result;
}

std::string CompareVerb::plain(const PictureDifference& difference) const {
    std::string text;
    if (difference.has_depth) {
        text += fmt::format("{:<12} {} pixels in A only, {} in B only, of {} and {}\n", "coverage",
                            difference.only_a, difference.only_b, difference.covered_a,
                            difference.covered_b);
        text += spreadText("  distance", difference.coverage_px, "px");
        text += spreadText("depth edges", difference.edge_px, "px");
        text += fmt::format("{:<12} {} pixels open in A only, {} in B only\n", "hairlines",
                            difference.hairline_a, difference.hairline_b);
        text += spreadText("depth", difference.depth_px, "px");
    }
    text += spreadText("shade", difference.shade, "of 255");
    if (max_px_ || max_shade_)
        text += withinLimits(difference) ? "within the limits\n" : "beyond the limits\n";
    return text;
}

int CompareVerb::run(const RunContext& context) {
    const Picture a = readPicture(a_), b = readPicture(b_);
    if (max_px_ && !(a.hasDepth() && b.hasDepth()))
        throw InputError(a.hasDepth() ? b_ : a_, "", "has no depth, by which --max-px is measured");
    const PictureDifference difference = compare(a, b, supersampled_);
    if (json_)
        printJson(json(difference));
    else
        printOut(plain(difference));
    writeReport(context.common.report, json(difference), context.common.force);
    return withinLimits(difference) ? 0 : 6;
}

}  // namespace

std::unique_ptr<Verb> makeCompareVerb() {
    return std::make_unique<CompareVerb>();
}

}  // namespace pietra
