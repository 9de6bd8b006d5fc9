#include "audit/adaptive_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "audit/mesh_topology.h"
#include "base/hash.h"

namespace pietra {
namespace {

double unitReal(uint64_t bits) {
    return double(mixBits(bits) >> 11) * 0x1p-53;
}

/// A threshold or a camera, a function of model and seed.
CutRequest randomRequest(const ModelReader& reader, uint64_t seed) {
    const uint64_t bits = mixBits(seed);
    CutRequest request;
    if (bits % 2 == 0) {
        const Node& node = reader.nodes()[mixBits(bits) % reader.nodes().size()];
        request.max_error = double(node.error) * (0.3 + 1.2 * unitReal(bits + 1));
        return request;
    }
    const ModelInfo& info = reader.info();
    const Vec3d low = info.lattice.toInput(info.bounds.min);
    const Vec3d size = info.lattice.toInput(info.bounds.max) - low;
    Camera camera;
    for (int k = 0; k < 3; ++k) {
        camera.target[k] = low[k] + size[k] * unitReal(bits + 2 + uint64_t(k));
        camera.eye[k] = low[k] + size[k] * (2 * unitReal(bits + 5 + uint64_t(k)) - 0.5);
    }
    camera.eye += 1e-3 * size;
    request.view.emplace(camera, PictureSize{}, info.lattice);
    request.pixels = std::exp2(8 * unitReal(bits + 8) - 2);
    return request;
}

class Checker {
public:
    Checker(const ModelReader& reader, AdaptiveModel& model, const ModelCheckSettings& settings,
            Budget& budget, Progress& progress)
        : reader_(reader),
          model_(model),
          settings_(settings),
          budget_(budget),
          progress_(progress) {}

    ModelCheckReport run() {
        progress_.setStages(2 + int(!settings_.input.empty()));
        progress_.beginStage("pages", reader_.pageCount());
        report_.file =
            verifyModel(reader_, progress_, [&](uint32_t page) { return model_.pageFault(page); });
        if (report_.file.ok()) checkCuts();
        if (report_.ok() && !settings_.input.empty()) checkInput();
        progress_.endStage();
        return std::move(report_);
    }

private:
    void tell(const std::string& what) {
        report_.faults.push_back(fmt::format("{}: {}", reader_.path(), what));
    }

    void checkCuts() {
        progress_.beginStage("cuts", settings_.cuts);
        if (const std::string fault = model_.modelFault(budget_); !fault.empty()) {
            ++report_.cuts.invalid;
            return tell(fault);
        }
        CutRequest coarsest;
        coarsest.max_triangles = 0;
        const MeshTopology expected = topologyOf(model_.cut(coarsest, budget_).mesh);
        for (uint64_t i = 0; i < settings_.cuts; ++i) {
            const CutRequest request = randomRequest(reader_, settings_.seed + i);
            const Mesh mesh = model_.cut(request, budget_).mesh;
            const MeshTopology found = topologyOf(mesh);
            ++report_.cuts.checked;
            report_.cuts.triangles += mesh.triangleCount();
            report_.cuts.degenerate_triangles += found.degenerate;
            report_.cuts.invalid += found != expected;
            if (found != expected)
                tell(fmt::format("cut {}: its topology is not that of the coarsest", i));
            progress_.tick();
        }
    }

    /// The finest cut states how far its rounding took it from the input.
    void checkInput() {
        progress_.beginStage("input", 0);
        const MeshCut finest = model_.cut({}, budget_);
        const auto source = openSource(settings_.input, settings_.temp_dir);
        InputTriangles input(*source, budget_, budget_.available() / 3, settings_.temp_dir);
        Node node;
        node.error = float(finest.max_error);
        node.triangles = uint32_t(finest.mesh.triangleCount());
        node.vertices = uint32_t(finest.mesh.vertexCount());
        const std::vector<Cut> cuts(1, Cut{{0}, node.error, node.triangles});
        CertificateOptions options;
        options.seed = settings_.seed;
        options.samples = std::min<uint64_t>(settings_.samples, budget_.available() / 2 / 256);
        const CertificateReport found =
            auditCertificate(
                {&node, 1}, cuts,
                [&](std::span<const NodeIndex> nodes, const PatchVisitor& visit) {
                    for (const NodeIndex n : nodes) visit(n, finest.mesh);
                },
                truthOfInput(input, reader_.info().lattice, reader_.info().input_triangles),
                options, budget_)
                .front();
        report_.certificate.cuts = 1;
        report_.certificate.samples = found.samples();
        report_.certificate.violations = found.violations();
        report_.certificate.worst_ratio = found.worstRatio();
        if (found.violations() > 0) tell("the finest cut is farther from the input than it states");
    }

    const ModelReader& reader_;
    AdaptiveModel& model_;
    const ModelCheckSettings& settings_;
    Budget& budget_;
    Progress& progress_;
    ModelCheckReport report_;
};

}  // namespace

ModelCheckReport checkAdaptive(const ModelReader& reader, AdaptiveModel& model,
                               const ModelCheckSettings& settings, Budget& budget,
                               Progress& progress) {
    return Checker(reader, model, settings, budget, progress).run();
}

}  // namespace pietra
