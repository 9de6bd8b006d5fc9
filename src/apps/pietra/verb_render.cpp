// pietra render: models in, a picture out. The patches of a cut are decoded, drawn and dropped, so
// that memory depends on the picture and the table of nodes, not on the triangles.

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/pietra/camera_options.h"
#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/scene.h"
#include "apps/pietra/verbs.h"
#include "base/budget.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "multires/cut.h"
#include "render/raster/rasteriser.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;
using Clock = std::chrono::steady_clock;

/// Drawn at a time, where memory allows: enough to keep all threads busy.
constexpr size_t kBatchBytes = size_t(256) << 20;

double msSince(Clock::time_point start) {
    return std::chrono::duration<double, std::milli>(Clock::now() - start).count();
}

const std::pair<const char*, Show> kShows[] = {
    {"shaded", Show::kShaded}, {"normals", Show::kNormals}, {"depth", Show::kDepth},
    {"lod", Show::kLod},       {"patches", Show::kPatches}, {"triangles", Show::kTriangles},
    {"error", Show::kError},   {"colour", Show::kColour},
};

struct RangeOfValues {
    float min = std::numeric_limits<float>::infinity();
    float max = -std::numeric_limits<float>::infinity();
    void add(float value) {
        min = std::min(min, value);
        max = std::max(max, value);
    }
    void add(const RangeOfValues& other) {
        add(other.min);
        add(other.max);
    }
};

/// One scalar's least and largest value on the coarsest cut.
RangeOfValues scalarRange(const ModelReader& model, int index) {
    const size_t count = model.info().schema.scalars.size();
    RangeOfValues range;
    std::mutex mutex;
    visitPatches(model, rootCut(model.nodes()).nodes, [&](NodeIndex, const Mesh& mesh) {
        RangeOfValues own;
        for (size_t v = 0; v < mesh.vertexCount(); ++v)
            own.add(mesh.scalar[v * count + size_t(index)]);
        const std::lock_guard lock(mutex);
        if (mesh.vertexCount() > 0) range.add(own);
    });
    return range;
}

/// A model with what is to be drawn of it.
struct ModelCut {
    const ModelReader* model;
    View view;
    Cut cut;
};

class RenderVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    void parseShow(const std::string& word);
    void parseRange(const std::string& text);
    Culling culling() const;
    ShadeSettings shading(const Scene& scene, const std::vector<ModelCut>& cuts) const;
    int scalarIndex(const Scene& scene) const;
    std::vector<ModelCut> select(const Scene& scene, const Camera& camera) const;
    size_t batchBytes(const Scene& scene, size_t in_flight) const;
    ReadTimes draw(const ModelCut& cut, size_t batch_bytes, size_t in_flight,
                   Rasteriser& rasteriser, Progress& progress) const;

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
    std::string cull_ = "all";
    bool two_sided_ = false;
    uint64_t ram_ = uint64_t(1) << 30;
    std::optional<uint64_t> jobs_;
};

VerbText RenderVerb::text() const {
    return {"render",
            "draw a picture of one or more models",
            {"FILE... -o OUT.png [options]"},
            {"Draws the models as finely as the tolerance asks for: no point of the picture is "
             "moved by "
             "more than --pixels from where the full mesh would put it. --pixels 0 draws the full "
             "mesh, "
             "streamed. No display and no graphics driver is needed.",
             "The picture is a PNG, with the depth of every pixel in a private chunk that other "
             "programs skip and `pietra compare` reads.",
             "Several models are drawn together, each in its own coordinates."},
            {{"the whole model from the front", "pietra render statue.pietra -o statue.png"},
             {"which level of detail is drawn where",
              "pietra render statue.pietra -o lod.png --view iso --show lod"},
             {"the full mesh from a given camera",
              "pietra render statue.pietra -o full.png --camera c.json --pixels 0"}},
            "What --show may show",
            {{"shaded", "the surface, lit, in its own colours where it has any"},
             {"normals", "the normal in view space, as red, green and blue"},
             {"depth", "near is light"},
             {"lod", "the level of detail"},
             {"patches", "the pieces that are loaded and drawn as one"},
             {"triangles", "each triangle in a colour of its own"},
             {"error", "the stated error, blue for none, red for the largest drawn"},
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
    options.custom("--show", "WHAT", "shaded", "What the colours mean, see below.",
                   [this](const std::string& word) { parseShow(word); });
    options.custom("--range", "MIN:MAX", "those of the coarsest cut",
                   "Values at the two ends of the colours of --show scalar:NAME.",
                   [this](const std::string& text) { parseRange(text); });
    options.choice("--renderer", renderer_, {"cpu"}, "What draws.");
    options.choice("--samples", samples_, {"1", "4"}, "Coverage samples a pixel.");
    options.choice("--cull", cull_, {"none", "frustum", "cone", "all"},
                   "What is left out: what lies outside the picture, closed parts that face away, "
                   "or both and what is smaller than half the tolerance.");
    options.flag("--two-sided", two_sided_, "Draw closed parts from behind, too.");
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

Culling RenderVerb::culling() const {
    const bool all = cull_ == "all";
    return {all || cull_ == "frustum", !two_sided_ && (all || cull_ == "cone"), all};
}

int RenderVerb::scalarIndex(const Scene& scene) const {
    const std::vector<std::string>& first = scene.models[0]->info().schema.scalars;
    const auto found = std::find(first.begin(), first.end(), scalar_);
    if (found == first.end())
        throw UsageError(fmt::format("{}: has no scalar '{}'", files_[0], scalar_));
    for (size_t i = 1; i < files_.size(); ++i)
        if (scene.models[i]->info().schema.scalars != first)
            throw UsageError(fmt::format("{}: has other scalars than {}", files_[i], files_[0]));
    return int(found - first.begin());
}

ShadeSettings RenderVerb::shading(const Scene& scene, const std::vector<ModelCut>& cuts) const {
    ShadeSettings settings;
    settings.show = show_;
    settings.two_sided = two_sided_;
    if (show_ == Show::kScalar) {
        settings.scalar_count = int(scene.models[0]->info().schema.scalars.size());
        settings.scalar_index = scalarIndex(scene);
        RangeOfValues range;
        if (range_)
            range = {float(range_->first), float(range_->second)};
        else
            for (const auto& model : scene.models)
                range.add(scalarRange(*model, settings.scalar_index));
        settings.scalar_min = range.min;
        settings.scalar_max = range.max > range.min ? range.max : range.min + 1;
    }
    if (show_ == Show::kColour)
        for (const auto& model : scene.models)
            if (!model->info().schema.colours)
                throw UsageError(fmt::format("{}: has no colours", model->path()));
    float most = 0;
    for (const ModelCut& cut : cuts)
        most = std::max(most, float(cut.cut.max_error * cut.model->info().lattice.step));
    settings.value_max = most > 0 ? most : 1;
    return settings;
}

std::vector<ModelCut> RenderVerb::select(const Scene& scene, const Camera& camera) const {
    std::vector<ModelCut> cuts;
    for (const auto& model : scene.models) {
        const View view(camera, size_, model->info().lattice);
        cuts.push_back({model.get(), view, visibleCut(model->nodes(), view, pixels_, culling())});
    }
    return cuts;
}

size_t RenderVerb::batchBytes(const Scene& scene, size_t in_flight) const {
    size_t page = 0;
    for (const auto& model : scene.models) page = std::max(page, largestDecodedPageBytes(*model));
    const size_t sample_bytes = samples_ == "4" ? 49 : 17;
    // A pixel's colour and depth are copied once more for the file; a vertex is transformed.
    const size_t fixed = scene.tableBytes() + (in_flight + 1) * page +
                         size_t(size_.width) * size_t(size_.height) * (sample_bytes + 8);
    if (fixed + page > ram_)
        throw MemoryError(fmt::format("--ram {}: drawing this needs {} at least", formatBytes(ram_),
                                      formatBytes(fixed + page)));
    return std::min(kBatchBytes, (ram_ - fixed) / 2);
}

ReadTimes RenderVerb::draw(const ModelCut& cut, size_t batch_bytes, size_t in_flight,
                           Rasteriser& rasteriser, Progress& progress) const {
    const double step = cut.model->info().lattice.step;
    std::vector<DecodedRun> batch;
    size_t bytes = 0;
    const auto flush = [&] {
        std::vector<DrawPatch> patches;
        for (const DecodedRun& run : batch)
            for (size_t i = 0; i < run.nodes.size(); ++i) {
                const Node& node = cut.model->nodes()[run.nodes[i]];
                const float value = show_ == Show::kError ? float(node.error * step) : node.level;
                patches.push_back({.mesh = &run.patches[i],
                                   .one_sided = node.closed,
                                   .id = run.nodes[i],
                                   .tint = {},
                                   .value = value});
            }
        rasteriser.draw(patches);
        progress.tick(patches.size());
        batch.clear();
        bytes = 0;
    };
    const ReadTimes times =
        visitInOrder(*cut.model, cut.cut.nodes, in_flight, [&](DecodedRun& run) {
            for (const Mesh& mesh : run.patches)
                bytes += mesh.vertexCount() * 24 + mesh.triangleCount() * 13;
            batch.push_back(std::move(run));
            if (bytes >= batch_bytes) flush();
        });
    flush();
    return times;
}

int RenderVerb::run(const RunContext& context) {
    const auto start = Clock::now();
    const size_t resident_before = residentBytes();
    const int jobs = Limits{{}, jobs_}.threads();
    const ThreadLimit threads(jobs);
    if (!output_.ends_with(".png")) throw UsageError(fmt::format("{}: is not named .png", output_));
    checkOutput(output_, context.common.force);
    const Scene scene(files_);
    const Camera camera = camera_.camera(scene.bounds(), size_);
    const auto select_start = Clock::now();
    const std::vector<ModelCut> cuts = select(scene, camera);
    const double select_ms = msSince(select_start);

    const size_t in_flight = size_t(jobs) + 1;
    const size_t batch = batchBytes(scene, in_flight);
    Rasteriser rasteriser(cuts[0].view, cuts[0].model->info().lattice, samples_ == "4" ? 4 : 1,
                          shading(scene, cuts));
    size_t patches = 0;
    for (const ModelCut& cut : cuts) patches += cut.cut.nodes.size();
    context.progress.setStages(1);
    context.progress.beginStage("draw", patches);
    ReadTimes reading;
    for (const ModelCut& cut : cuts) {
        rasteriser.setModel(cut.view, cut.model->info().lattice);
        const ReadTimes times = draw(cut, batch, in_flight, rasteriser, context.progress);
        reading.load_ms += times.load_ms;
        reading.decode_ms += times.decode_ms;
    }
    const Picture& picture = rasteriser.finish();
    context.progress.endStage();
    writePng(picture, output_, context.common.force);

    const RasterStatistics& statistics = rasteriser.statistics();
    const double total_ms = msSince(start);
    const size_t peak = peakResidentBytes();
    logInfo(fmt::format("{}: {} triangles in {} patches, {:.0f} ms", output_,
                        formatCount(double(statistics.triangles)), statistics.patches, total_ms));
    writeReport(context.common.report,
                Json{{"triangles", statistics.triangles},
                     {"patches", statistics.patches},
                     {"pixels_covered", statistics.pixels_covered},
                     {"ms",
                      {{"select", select_ms},
                       {"load", reading.load_ms},
                       {"decode", reading.decode_ms},
                       {"draw", statistics.totalMs()},
                       {"total", total_ms}}},
                     {"resident_bytes",
                      {{"ram", peak > resident_before ? peak - resident_before : 0}, {"vram", 0}}},
                     {"tolerance_px", pixels_}},
                context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeRenderVerb() {
    return std::make_unique<RenderVerb>();
}

}  // namespace pietra
