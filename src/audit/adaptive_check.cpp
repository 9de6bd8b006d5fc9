#include "audit/adaptive_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>

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

Truth truthOfMesh(const Mesh& mesh) {
    Truth truth;
    truth.triangles = mesh.triangleCount();
    truth.stream = [&mesh](const Truth::Visitor& visit) {
        std::vector<TriangleCorners> run;
        for (size_t t = 0; t < mesh.triangleCount(); ++t) {
            const Triangle& f = mesh.triangle[t];
            run.push_back({Vec3d(mesh.position[f[0]]), Vec3d(mesh.position[f[1]]),
                           Vec3d(mesh.position[f[2]])});
        }
        visit(0, kNoNode, run);
    };
    return truth;
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
        progress_.setStages(2 + int(settings_.samples > 0));
        progress_.beginStage("pages", reader_.pageCount());
        report_.file =
            verifyModel(reader_, progress_, [&](uint32_t page) { return model_.pageFault(page); });
        if (report_.file.ok()) checkCuts();
        if (report_.ok() && settings_.samples > 0) checkCertificate();
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

    /// Cuts by error, each half as fine as the one before, the finest one first; and seeded ones.
    std::vector<CutRequest> cutsToAudit() const {
        std::vector<CutRequest> requests(1);
        double error = 0;
        for (const Node& node : reader_.nodes()) error = std::max(error, double(node.error));
        for (int i = kHalvings; i >= 0; --i)
            requests.emplace_back().max_error = std::ldexp(error, -i);
        for (uint64_t i = 0; i < settings_.cuts; ++i)
            requests.push_back(randomRequest(reader_, settings_.seed + i));
        return requests;
    }

    void checkCertificate() {
        const std::vector<CutRequest> requests = cutsToAudit();
        progress_.beginStage("certificate", requests.size());
        std::unique_ptr<TriangleSource> source;
        std::optional<InputTriangles> input;
        MeshCut finest;
        Truth truth;
        if (settings_.input.empty()) {
            finest = model_.cut({}, budget_);
            truth = truthOfMesh(finest.mesh);
        } else {
            source = openSource(settings_.input, settings_.temp_dir);
            input.emplace(*source, budget_, budget_.available() / 3, settings_.temp_dir);
            truth = truthOfInput(*input, reader_.info().lattice, reader_.info().input_triangles);
        }
        report_.certificate.against_input = input.has_value();
        std::vector<CertificateReport> by_error;
        for (size_t i = 0; i < requests.size(); ++i) {
            CertificateReport found = audit(model_.cut(requests[i], budget_), truth);
            report_.certificate.cuts += 1;
            report_.certificate.samples += found.samples();
            report_.certificate.violations += found.violations();
            report_.certificate.worst_ratio =
                std::max(report_.certificate.worst_ratio, found.worstRatio());
            if (found.violations() > 0)
                tell(fmt::format("cut {} is farther from the input than it states", i));
            for (GroupTightness& group : found.groups) group.height = uint16_t(i);
            if (i <= kHalvings + 1) by_error.push_back(std::move(found));
            progress_.tick();
        }
        report_.certificate.tightness = tightnessTable(by_error);
    }

    /// Each triangle by what is stated of it; then groups are runs, which lie together, by the most
    /// that is stated of a triangle in them.
    CertificateReport audit(const MeshCut& cut, const Truth& truth) const {
        std::vector<Node> nodes;
        std::vector<Mesh> patch;
        std::map<std::pair<size_t, float>, NodeIndex> node_of;
        for (size_t t = 0; t < cut.mesh.triangleCount(); ++t) {
            const auto [at, is_new] =
                node_of.try_emplace({t / kRun, cut.error[t]}, NodeIndex(nodes.size()));
            if (is_new) {
                nodes.emplace_back().error = cut.error[t];
                nodes.back().group = at->second;
                patch.emplace_back();
            }
            Mesh& mesh = patch[at->second];
            const auto first = uint32_t(mesh.vertexCount());
            for (const uint32_t v : cut.mesh.triangle[t])
                mesh.position.push_back(cut.mesh.position[v]);
            mesh.triangle.push_back({first, first + 1, first + 2});
            ++nodes[at->second].triangles;
        }
        CertificateOptions options;
        options.seed = settings_.seed;
        options.samples = std::min<uint64_t>(settings_.samples, budget_.available() / 2 / 256);
        Cut all{{}, float(cut.max_error), cut.mesh.triangleCount()};
        for (NodeIndex n = 0; n < nodes.size(); ++n) all.nodes.push_back(n);
        CertificateReport report =
            auditCertificate(
                nodes, {&all, 1},
                [&](std::span<const NodeIndex> wanted, const PatchVisitor& visit) {
                    for (const NodeIndex n : wanted) visit(n, patch[n]);
                },
                truth, options, budget_)
                .front();
        std::map<size_t, GroupTightness> runs;
        std::vector<size_t> run_of(nodes.size());
        for (const auto& [key, n] : node_of) run_of[n] = key.first;
        for (const GroupTightness& found : report.groups) {
            GroupTightness& run = runs[run_of[found.group]];
            run.group = uint32_t(run_of[found.group]);
            run.stated = std::max(run.stated, found.stated);
            run.measured = std::max(run.measured, found.measured);
            run.samples += found.samples;
        }
        report.groups.clear();
        for (const auto& [unused, run] : runs) report.groups.push_back(run);
        return report;
    }

    static constexpr size_t kRun = 1024;
    static constexpr int kHalvings = 9;
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
