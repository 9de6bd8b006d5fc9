// pietra render: models in, a picture out.

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <optional>
#include <sstream>

#include "apps/pietra/camera_options.h"
#include "apps/pietra/draw_options.h"
#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/model_files.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "methods/method_table.h"
#include "multires/standard_views.h"
#include "render/offline/offline_picture.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

const std::pair<const char*, Show> kShows[] = {
    {"shaded", Show::kShaded}, {"normals", Show::kNormals}, {"depth", Show::kDepth},
    {"lod", Show::kLod},       {"patches", Show::kPatches}, {"triangles", Show::kTriangles},
    {"wire", Show::kWire},     {"error", Show::kError},     {"colour", Show::kColour},
};

class RenderVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    void parseShow(const std::string& word);
    void parseRange(const std::string& text);
    void parseLight(const std::string& text);
    OfflineSettings settings(const ModelFiles& files) const;
    void showScalar(const ModelFiles& files, ShadeSettings& shade) const;
    OfflinePicture draw(const ModelFiles& files, const Camera& camera, Progress& progress) const;
    Json report(const OfflineStatistics& statistics, bool proven, size_t resident_bytes) const;

    std::vector<std::string> files_;
    std::string output_;
    PictureSize size_;
    CameraOptions camera_;
    double pixels_ = 1;
    Show show_ = Show::kShaded;
    std::string scalar_;
    std::optional<std::pair<double, double>> range_;
    std::string renderer_ = "cpu";
    std::string samples_ = "1";
    SelectOption select_;
    CullOption cull_;
    bool two_sided_ = false;
    Vec3d light_ = ShadeSettings{}.light_direction;
    uint64_t ram_ = uint64_t(1) << 30;
    std::optional<uint64_t> jobs_;
};

VerbText RenderVerb::text() const {
    return {"render",
            "draw a picture of one or more models",
            {"FILE... -o OUT.png [options]"},
            {"Draws the models as finely as the tolerance asks for: no point of the picture is "
             "moved by more than --pixels from where the full mesh would put it. --pixels 0 draws "
             "the full mesh, streamed: memory stays within --ram, however large the models are. No "
             "display is needed, "
             "and no graphics driver but for --renderer gl.",
             "The picture is a PNG, with the depth of every pixel in a private chunk that other "
             "programs skip and `pietra compare` reads.",
             "Several models are drawn together, each in its own coordinates."},
            {{"the whole model from the front", "pietra render statue.pietra -o statue.png"},
             {"which level of detail is drawn where",
              "pietra render statue.pietra -o lod.png --view iso --show lod"},
             {"the full mesh from a given camera, with smooth edges",
              "pietra render statue.pietra -o full.png --camera c.json --pixels 0 --samples 4"}},
            "What --show may show",
            {{"shaded", "the surface, lit, in its own colours where it has any"},
             {"normals", "the normal in view space, as red, green and blue"},
             {"depth", "near is light"},
             {"lod", "the level of detail"},
             {"patches", "the pieces that are loaded and drawn as one"},
             {"triangles", "each triangle in a colour of its own"},
             {"wire", "the triangles' edges as lines"},
             {"error",
              "how far the stated error may show, from blue for none to red for --pixels (or "
              "for the largest there is, with --pixels 0)"},
             {"colour", "the model's own colours, unlit"},
             {"scalar:NAME", "a scalar attribute of the model, in a colour map"}}};
}

void RenderVerb::declare(OptionSet& options) {
    options.files("FILE", files_, "The models.").require();
    options.text("-o,--output", "OUT.png", output_, "The picture to write.").require();
    options.pictureSize("--size", size_, "Of the picture, in pixels.");
    camera_.declare(options);
    options.number("--pixels", "T", pixels_, {.min = 0},
                   "Tolerance in pixels; 0 draws the full mesh.");
    select_.declare(options);
    options.custom("--show", "WHAT", "shaded", "What the colours mean, see above.",
                   [this](const std::string& word) { parseShow(word); });
    options.custom("--range", "MIN:MAX", "those of the coarsest cut",
                   "Values at the two ends of the colours of --show scalar:NAME.",
                   [this](const std::string& text) { parseRange(text); });
    options.choice("--renderer", renderer_, {"cpu", "gl"}, "What draws.");
    options.choice("--samples", samples_, {"1", "4"}, "Coverage samples a pixel.");
    cull_.declare(options,
                  "What is left out: what lies outside the picture; closed parts that face away; "
                  "what is hidden, which --renderer gl cannot know in a single picture; or all of "
                  "these and what is smaller than half the tolerance.");
    options.flag("--two-sided", two_sided_, "Draw and light closed parts from both sides, too.");
    options.custom("--light", "X,Y,Z", "-0.45,0.65,0.6",
                   "Towards the light: to the right, up, towards the viewer.",
                   [this](const std::string& text) { parseLight(text); });
    options.size("--ram", ram_, "Most memory for the models and the picture.");
    options.count("-j,--jobs", "N", jobs_, {.min = 1, .max = 1024}, "Threads to work with.")
        .defaultsTo("all cores");
}

void RenderVerb::parseShow(const std::string& word) {
    scalar_.clear();
    if (word.starts_with("scalar:")) {
        show_ = Show::kScalar;
        scalar_ = word.substr(7);
        return;
    }
    std::string known;
    for (const auto& [name, show] : kShows) {
        if (word == name) {
            show_ = show;
            return;
        }
        known += std::string(name) + ", ";
    }
    throw UsageError(fmt::format("'{}' is none of {}scalar:NAME", word, known));
}

void RenderVerb::parseRange(const std::string& text) {
    const size_t colon = text.find(':');
    if (colon == text.npos) throw UsageError(fmt::format("'{}' is not of the form MIN:MAX", text));
    const double low = parseNumber(text.substr(0, colon));
    range_ = {low, parseNumber(text.substr(colon + 1), {.min = low, .above = true})};
}

void RenderVerb::parseLight(const std::string& text) {
    std::istringstream in(text);
    std::vector<double> v;
    for (std::string part; std::getline(in, part, ',');) v.push_back(parseNumber(part));
    if (v.size() != 3) throw UsageError(fmt::format("'{}' is not of the form X,Y,Z", text));
    light_ = {v[0], v[1], v[2]};
    if (glm::dot(light_, light_) == 0) throw UsageError(fmt::format("'{}' is no direction", text));
}

void RenderVerb::showScalar(const ModelFiles& files, ShadeSettings& shade) const {
    const std::vector<std::string>& first = files.models[0]->info().schema.scalars;
    const auto found = std::find(first.begin(), first.end(), scalar_);
    if (found == first.end())
        throw UsageError(fmt::format("{}: has no scalar '{}'", files_[0], scalar_));
    for (size_t i = 1; i < files_.size(); ++i)
        if (files.models[i]->info().schema.scalars != first)
            throw UsageError(fmt::format("{}: has other scalars than {}", files_[i], files_[0]));
    shade.scalar_count = int(first.size());
    shade.scalar_index = int(found - first.begin());
    std::tie(shade.scalar_min, shade.scalar_max) =
        range_ ? std::pair(float(range_->first), float(range_->second))
               : scalarRange(files.views(), shade.scalar_index);
}

OfflineSettings RenderVerb::settings(const ModelFiles& files) const {
    OfflineSettings settings;
    settings.pixels = pixels_;
    settings.select = select_.selectBy(files.views());
    settings.culling = cull_.culling();
    settings.culling.cone &= !two_sided_;
    settings.renderer = renderer_ == "gl" ? DrawWith::kGl : DrawWith::kCpu;
    settings.samples = samples_ == "4" ? 4 : 1;
    settings.memory_bytes = size_t(ram_);
    settings.open_live = openLive;
    settings.jobs = Limits{{}, jobs_}.threads();
    settings.shade.show = show_;
    settings.shade.two_sided = two_sided_;
    settings.shade.light_direction = light_;
    if (show_ == Show::kScalar) showScalar(files, settings.shade);
    if (show_ == Show::kColour)
        for (const auto& model : files.models)
            if (!model->info().schema.colours)
                throw UsageError(fmt::format("{}: has no colours", model->path()));
    return settings;
}

Json RenderVerb::report(const OfflineStatistics& s, bool proven, size_t resident_bytes) const {
    return {{"triangles", s.triangles},
            {"patches", s.patches},
            {"pixels_covered", s.pixels_covered},
            {"ms",
             {{"select", s.select_ms},
              {"load", s.load_ms},
              {"decode", s.decode_ms},
              {"draw", s.draw_ms},
              {"total", s.total_ms}}},
            {"resident_bytes", {{"ram", resident_bytes}, {"vram", s.device_bytes}}},
            {"tolerance_px", s.tolerance_px},
            {"errors_proven", proven}};
}

OfflinePicture RenderVerb::draw(const ModelFiles& files, const Camera& camera,
                                Progress& progress) const {
    const OfflineSettings offline = settings(files);
    try {
        return drawModels(files.views(), camera, size_, offline, progress);
    } catch (const MemoryError& error) {
        throw MemoryError(fmt::format("--ram {}: {}", formatBytes(ram_), error.what()));
    } catch (const UsageError& error) {
        throw UsageError(fmt::format("--renderer {}: {}", renderer_, error.what()));
    }
}

int RenderVerb::run(const RunContext& context) {
    const size_t resident_before = residentBytes();
    const ThreadLimit threads(Limits{{}, jobs_}.threads());
    if (!output_.ends_with(".png")) throw UsageError(fmt::format("{}: is not named .png", output_));
    checkOutput(output_, context.common.force);
    const ModelFiles files(files_);
    Camera camera = camera_.camera(files.bounds(), size_);
    if (!camera_.fileGiven()) camera = movedCloser(camera, files.balls(), size_);
    context.progress.setStages(1);
    const OfflinePicture drawn = draw(files, camera, context.progress);
    const size_t resident = peakResidentBytes();
    writePng(drawn.picture, output_, context.common.force);
    if (drawn.statistics.tolerance_px > pixels_)
        logWarning(fmt::format("--ram {} is too little for {} px: drawn at {:.3g} px",
                               formatBytes(ram_), pixels_, drawn.statistics.tolerance_px));
    logInfo(fmt::format("{}: {} triangles in {} patches, {:.0f} ms", output_,
                        formatCount(double(drawn.statistics.triangles)), drawn.statistics.patches,
                        drawn.statistics.total_ms));
    writeReport(context.common.report,
                report(drawn.statistics, files.proveErrors(),
                       resident > resident_before ? resident - resident_before : 0),
                context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeRenderVerb() {
    return std::make_unique<RenderVerb>();
}

}  // namespace pietra
