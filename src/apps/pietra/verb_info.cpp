// pietra info: what a model says about itself.

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>

#include "apps/pietra/json_report.h"
#include "apps/pietra/verbs.h"
#include "base/text.h"
#include "methods/method_table.h"
#include "store/model_reader.h"

namespace pietra {

namespace {

using Json = nlohmann::ordered_json;

Json vectorJson(const Vec3d& v) {
    return {v.x, v.y, v.z};
}

std::vector<std::string> attributeNames(const AttributeSchema& schema) {
    std::vector<std::string> names{"normals"};
    if (schema.colours) names.push_back("colours");
    for (const std::string& scalar : schema.scalars) names.push_back("scalar:" + scalar);
    return names;
}

/// Of the coarsest cut, in the input's units: the largest error that any node states.
double maxError(const ModelReader& model) {
    float most = 0;
    for (const Node& node : model.nodes()) most = std::max(most, node.error);
    return most * model.info().lattice.step;
}

/// Of all nodes; of a progressive mesh, its operations.
uint64_t storedVertices(const ModelReader& model) {
    uint64_t vertices = 0;
    for (const Node& node : model.nodes()) vertices += node.vertices;
    return vertices;
}

double bytesPerTriangle(const ModelReader& model) {
    return double(model.fileBytes()) / double(std::max<uint64_t>(model.info().input_triangles, 1));
}

Json infoJson(const ModelReader& model) {
    const ModelInfo& info = model.info();
    return {{"method", info.method},
            {"format_version", model.formatVersion()},
            {"input",
             {{"triangles", info.input_triangles},
              {"vertices", info.input_vertices},
              {"files", info.input_files}}},
            {"bounds",
             {{"min", vectorJson(info.lattice.toInput(info.bounds.min))},
              {"max", vectorJson(info.lattice.toInput(info.bounds.max))}}},
            {"precision", info.lattice.vertexStep()},
            {"attributes", attributeNames(info.schema)},
            {"normals_given", info.schema.normals_given},
            {"levels", info.levels},
            {"nodes", model.nodes().size()},
            {"pages", model.pageCount()},
            {"triangles_stored", info.triangles_stored},
            {"vertices_stored", storedVertices(model)},
            {"bytes", model.fileBytes()},
            {"bytes_per_input_triangle", bytesPerTriangle(model)},
            {"max_error", maxError(model)},
            {"errors_proven", provesErrors(info)},
            {"quantisation_error", info.quantisation_error * info.lattice.step},
            {"dropped",
             {{"degenerate", info.dropped_degenerate}, {"duplicate", info.dropped_duplicate}}}};
}

std::string infoText(const ModelReader& model) {
    const ModelInfo& info = model.info();
    const Vec3d low = info.lattice.toInput(info.bounds.min);
    const Vec3d high = info.lattice.toInput(info.bounds.max);
    std::string attributes;
    for (const std::string& name : attributeNames(info.schema))
        attributes += (attributes.empty() ? "" : ", ") + name;
    const auto line = [](const char* name, const std::string& value) {
        return fmt::format("{:<14} {}\n", name, value);
    };
    return line("model", model.path()) +
           line("method", fmt::format("{}, format {}", info.method, model.formatVersion())) +
           line("input", fmt::format("{} triangles, {} vertices, {} file{}", info.input_triangles,
                                     info.input_vertices, info.input_files,
                                     info.input_files == 1 ? "" : "s")) +
           line("left out", fmt::format("{} degenerate, {} duplicate", info.dropped_degenerate,
                                        info.dropped_duplicate)) +
           line("bounds", fmt::format("{:.9g} {:.9g} {:.9g} to {:.9g} {:.9g} {:.9g}", low.x, low.y,
                                      low.z, high.x, high.y, high.z)) +
           line("precision", fmt::format("{:.6g}", info.lattice.vertexStep())) +
           line("attributes", attributes) +
           line("stored", fmt::format("{} triangles in {} nodes of {} levels",
                                      info.triangles_stored, model.nodes().size(), info.levels)) +
           line("size", fmt::format("{}, {:.2f} bytes an input triangle",
                                    formatBytes(model.fileBytes()), bytesPerTriangle(model))) +
           line("largest error", fmt::format("{:.6g}{}", maxError(model),
                                             provesErrors(info) ? "" : ", an estimate"));
}

class InfoVerb : public Verb {
public:
    VerbText text() const override {
        return {"info",
                "say what a model holds",
                {"FILE [--json]"},
                {"Prints what the model says about itself: its input, its extent, its resolution, "
                 "its size, and the largest error of its coarsest form. Lengths are in the input's "
                 "units, sizes in bytes."},
                {{"at a glance", "pietra info statue.pietra"},
                 {"for a script", "pietra info statue.pietra --json"}}};
    }
    void declare(OptionSet& options) override {
        options.file("FILE", file_, "The model.").require();
        options.flag("--json", json_, "Print JSON.");
    }
    int run(const RunContext& context) override {
        const ModelReader model(file_);
        if (json_)
            printJson(infoJson(model));
        else
            printOut(infoText(model));
        writeReport(context.common.report, infoJson(model), context.common.force);
        return 0;
    }

private:
    std::string file_;
    bool json_ = false;
};

}  // namespace

std::unique_ptr<Verb> makeInfoVerb() {
    return std::make_unique<InfoVerb>();
}

}  // namespace pietra
