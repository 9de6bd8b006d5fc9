// pietra extract: a cut of a model as a mesh file.

#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

#include "apps/pietra/camera_options.h"
#include "apps/pietra/json_report.h"
#include "apps/pietra/limits.h"
#include "apps/pietra/logging.h"
#include "apps/pietra/verbs.h"
#include "base/error.h"
#include "base/parallel.h"
#include "base/text.h"
#include "io/mesh_writer.h"
#include "methods/method_table.h"
#include "multires/cut.h"
#include "runtime/export_cut.h"
#include "runtime/patch_reader.h"

namespace pietra {

namespace {

constexpr size_t kProgramBytes = size_t(64) << 20;

/// Not above `error` in the input's units, also after rounding back and forth.
double latticeError(double error, const Lattice& lattice) {
    double e = error / lattice.step;
    while (e > 0 && e * lattice.step > error) e = std::nextafter(e, 0.0);
    return e;
}

class ExtractVerb : public Verb {
public:
    VerbText text() const override;
    void declare(OptionSet& options) override;
    int run(const RunContext& context) override;

private:
    Cut select(const ModelReader& model) const;
    CutRequest request(const Lattice& lattice) const;
    template <class ExportTo>
    ExportReport write(const ModelReader& model, uint64_t triangles, const RunContext& context,
                       const ExportTo& export_to) const;
    ExportReport writeCut(const ModelReader& model, double& max_error, const RunContext& context);
    ExportReport writeAdaptive(const ModelReader& model, double& max_error,
                               const RunContext& context);
    size_t budgetBytes(const ModelReader& model, size_t in_flight) const;
    std::string tempDir() const;

    std::string file_;
    std::string output_;
    std::optional<double> error_;
    std::optional<uint64_t> triangles_;
    bool full_ = false;
    CameraOptions camera_;
    double pixels_ = 1;
    PictureSize size_;
    Limits limits_;
    std::string temp_dir_;
};

VerbText ExtractVerb::text() const {
    return {"extract",
            "write a model, as fine as asked for, as a mesh",
            {"FILE -o OUT.ply (--error E | --triangles N | --full) [options]",
             "FILE -o OUT.ply --camera C.json [--pixels T] [--size WxH] [options]"},
            {"Writes one crack-free mesh from a model: with an error of at most E, with at most N "
             "triangles, in full, or as fine as a picture from a camera needs (nothing is culled). "
             "Positions are in the input's own coordinates, as double where float would lose "
             "precision; "
             "all attributes come along.",
             "The ending of the name decides the format: .ply, .obj, .stl or .glb."},
            {{"within a tenth of a millimetre, where the unit is mm",
              "pietra extract statue.pietra -o print.stl --error 0.1"},
             {"for a web page", "pietra extract statue.pietra -o small.glb --triangles 100k"},
             {"the input back, on the model's lattice",
              "pietra extract statue.pietra -o all.ply --full"}}};
}

void ExtractVerb::declare(OptionSet& options) {
    options.file("FILE", file_, "The model.").require();
    options.text("-o,--output", "OUT.ply", output_, "The mesh to write.").require();
    options.number("--error", "E", error_, {.min = 0},
                   "Every part is within E of the input, in the input's units, with as few "
                   "triangles as the model allows.");
    options.count("--triangles", "N", triangles_, {.min = 1},
                  "The mesh of least error with at most N triangles.");
    options.flag("--full", full_, "All triangles of the input.");
    camera_.declareFile(options);
    camera_.declareUp(options, "Which axis points up in cameras that do not say.");
    options.number("--pixels", "T", pixels_, {.min = 0}, "With --camera: tolerance in pixels.");
    options.pictureSize("--size", size_, "With --camera: of the picture, in pixels.");
    limits_.declare(options);
    options.text("--temp-dir", "DIR", temp_dir_, "Where temporary files go.")
        .defaultsTo("the folder of the output");
}

std::string ExtractVerb::tempDir() const {
    if (!temp_dir_.empty()) return temp_dir_;
    const size_t slash = output_.rfind('/');
    return slash == std::string::npos ? "." : output_.substr(0, slash + 1);
}

Cut ExtractVerb::select(const ModelReader& model) const {
    const Lattice& lattice = model.info().lattice;
    if (error_) return cutByError(model.nodes(), latticeError(*error_, lattice));
    if (triangles_) return cutByTriangles(model.nodes(), *triangles_);
    if (full_ || pixels_ == 0) return finestCut(model.nodes());
    return cutByView(model.nodes(), View(camera_.fromFile(), size_, lattice), pixels_);
}

size_t ExtractVerb::budgetBytes(const ModelReader& model, size_t in_flight) const {
    const size_t taken = kProgramBytes + model.nodes().size() * (sizeof(Node) + 32) +
                         (in_flight + 1) * largestDecodedPageBytes(model);
    return limits_.memoryBytes(taken + (size_t(16) << 20), "extracting from this model") - taken;
}

CutRequest ExtractVerb::request(const Lattice& lattice) const {
    CutRequest request;
    if (error_) request.max_error = latticeError(*error_, lattice);
    request.max_triangles = triangles_;
    if (camera_.fileGiven()) request.view.emplace(camera_.fromFile(), size_, lattice);
    request.pixels = pixels_;
    return request;
}

void warnAbout(bool below_finest, bool over_budget, double max_error, uint64_t triangles) {
    if (below_finest)
        logWarning(fmt::format(
            "no part of the model states less than {:.6g}: the finest is written", max_error));
    if (over_budget)
        logWarning(fmt::format(
            "the coarsest form has {} triangles, more than asked for: it is written", triangles));
}

/// export_to(writer) writes the mesh.
template <class ExportTo>
ExportReport ExtractVerb::write(const ModelReader& model, uint64_t triangles,
                                const RunContext& context, const ExportTo& export_to) const {
    const auto writer =
        createMesh(output_, context.common.force, meshOutputOf(model.info(), triangles));
    const ExportReport report = export_to(*writer);
    context.progress.endStage();
    for (const std::string& note : writer->notes()) logWarning(note);
    return report;
}

ExportReport ExtractVerb::writeCut(const ModelReader& model, double& max_error,
                                   const RunContext& context) {
    const size_t in_flight = size_t(limits_.threads()) + 1;
    Budget budget(budgetBytes(model, in_flight));
    const Cut cut = select(model);
    max_error = cut.max_error * model.info().lattice.step;
    warnAbout(cut.below_finest, cut.over_budget, max_error, cut.triangles);
    return write(model, cut.triangles, context, [&](MeshWriter& writer) {
        context.progress.beginStage("extract", exportSteps(cut));
        return exportCut(model, cut, writer, {tempDir(), in_flight}, budget, context.progress);
    });
}

ExportReport ExtractVerb::writeAdaptive(const ModelReader& model, double& max_error,
                                        const RunContext& context) {
    const size_t taken = kProgramBytes + model.nodes().size() * sizeof(Node);
    Budget budget(limits_.memoryBytes(taken, "extracting from this model") - taken);
    const auto adaptive = openAdaptive(model);
    context.progress.beginStage("extract", 0);
    const MeshCut cut = adaptive->cut(request(model.info().lattice), budget);
    max_error = cut.max_error * model.info().lattice.step;
    warnAbout(cut.below_finest, cut.over_budget, max_error, cut.mesh.triangleCount());
    return write(model, cut.mesh.triangleCount(), context, [&](MeshWriter& writer) {
        return exportMesh(model.info(), cut.mesh, writer, context.progress);
    });
}

int ExtractVerb::run(const RunContext& context) {
    const int ways = int(error_.has_value()) + int(triangles_.has_value()) + int(full_) +
                     int(camera_.fileGiven());
    if (ways != 1)
        throw UsageError("give one of --error, --triangles, --full and --camera, to say how fine");
    checkOutput(output_, context.common.force);
    const ThreadLimit threads(limits_.threads());
    const ModelReader model(file_);
    double max_error = 0;
    context.progress.setStages(1);
    const ExportReport report = model.hasPatches() ? writeCut(model, max_error, context)
                                                   : writeAdaptive(model, max_error, context);
    logInfo(fmt::format("{}: {} triangles, {} vertices, error {} {:.6g}", output_, report.triangles,
                        report.vertices, provesErrors(model.info()) ? "at most" : "estimated at",
                        max_error));
    writeReport(
        context.common.report,
        {{"triangles", report.triangles}, {"vertices", report.vertices}, {"max_error", max_error}},
        context.common.force);
    return 0;
}

}  // namespace

std::unique_ptr<Verb> makeExtractVerb() {
    return std::make_unique<ExtractVerb>();
}

}  // namespace pietra
