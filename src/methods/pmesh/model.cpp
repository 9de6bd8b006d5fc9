#include "methods/pmesh/model.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/error.h"
#include "base/parallel.h"
#include "methods/pmesh/adaption.h"
#include "methods/pmesh/node_codec.h"

namespace pietra::pmesh {
namespace {

class Model : public AdaptiveModel {
public:
    explicit Model(const ModelReader& reader) : reader_(reader), forest_(openForest(reader)) {}

    std::string pageFault(uint32_t page) const override;
    std::string modelFault(Budget& budget) override;
    MeshCut cut(const CutRequest& request, Budget& budget) override;

private:
    std::string load(Budget& budget);
    double errorOf(uint32_t code) const;
    void refineTo(uint64_t max_triangles, std::unique_ptr<Adaption>& adaption) const;
    MeshCut toCut(const ActiveMesh& mesh) const;

    const ModelReader& reader_;
    NodeForest forest_;  // its nodes only while loading
    ProgressiveMesh mesh_;
    Reservation memory_;
    bool loaded_ = false;
};

std::string Model::pageFault(uint32_t page) const {
    const NodeIndex n = page;
    OperationNode node, child;
    if (std::string fault = readNode(reader_, forest_, n, node); !fault.empty()) return fault;
    for (const NodeIndex c : forest_.row[n].child) {
        // A child that cannot be read is its own page's fault.
        if (c == kNoNode || !readNode(reader_, forest_, c, child).empty()) continue;
        if (const std::string fault = faultBetween(forest_.row[n], node, c, child); !fault.empty())
            return fmt::format("node {}, which it refers to: {}", c, fault);
    }
    return "";
}

std::string Model::load(Budget& budget) {
    if (loaded_) return "";
    uint64_t operations = 0;
    for (const NodeRow& row : forest_.row) operations += row.operations;
    const size_t words = 12 * size_t(forest_.layout.words());  // of both ends, and of a cut
    memory_ = budget.reserve((kModelBytes + words) * (operations + forest_.base_vertex.size()),
                             "a progressive mesh, whole in memory,");
    forest_.node.resize(forest_.row.size());
    std::vector<std::string> fault(forest_.row.size());
    parallelFor(forest_.row.size(), [&](size_t n) {
        fault[n] = readNode(reader_, forest_, NodeIndex(n), forest_.node[n]);
    });
    for (NodeIndex n = 0; n < fault.size(); ++n)
        if (!fault[n].empty())
            throw InputError::atByte(reader_.path(), reader_.page(n).offset, fault[n]);
    mesh_ = fromNodes(forest_);
    forest_.node.clear();
    std::string whole = validate(mesh_);
    if (whole.empty()) whole = validateStars(mesh_);
    loaded_ = whole.empty();
    return whole;
}

std::string Model::modelFault(Budget& budget) {
    return load(budget);
}

double Model::errorOf(uint32_t code) const {
    return double(decodeError(code)) * kErrorUnit * double(1 << mesh_.lattice.shift) +
           double(reader_.info().quantisation_error);
}

MeshCut Model::toCut(const ActiveMesh& mesh) const {
    MeshCut cut;
    cut.max_error = errorOf(0);
    for (const Vertex& v : mesh.vertex) {
        cut.mesh.position.push_back(v.position() * (1 << mesh_.lattice.shift));
        cut.mesh.normal.push_back(unpackNormal(v.normal));
    }
    const WordLayout layout = mesh_.layout;
    cut.mesh.colour.resize(mesh.vertexCount() * layout.colours);
    cut.mesh.scalar.resize(mesh.vertexCount() * layout.scalars);
    for (size_t v = 0; v < mesh.vertexCount() && layout.words() > 0; ++v)
        setVertex(mesh_.wordsOf(mesh.pulse[v].name, mesh.record[v].last), layout, cut.mesh, v);
    for (const ActiveFace& f : mesh.face) {
        cut.mesh.triangle.push_back({f.vertex[0], f.vertex[1], f.vertex[2]});
        uint32_t code = 0;
        for (size_t k = 0; k < 3; ++k)
            code = std::max<uint32_t>(code, mesh.criteria[f.vertex[k]].split_error);
        const double error = errorOf(code);
        cut.max_error = std::max(cut.max_error, error);
        cut.error.push_back(float(error));
    }
    cut.mesh.edge_class.assign(cut.mesh.triangleCount(), 0);
    return cut;
}

/// By bisection over the codes of errors.
void Model::refineTo(uint64_t max_triangles, std::unique_ptr<Adaption>& adaption) const {
    const auto settled = [&](uint32_t code) {
        adaption = std::make_unique<Adaption>(mesh_);
        adaption->settle(criterionOf(
            (double(decodeError(code)) + 0.5) * kErrorUnit * double(1 << mesh_.lattice.shift),
            mesh_.lattice));
        return adaption->mesh().faceCount() <= max_triangles;
    };
    uint32_t low = 0, high = kMaxErrorCode;  // high serves, or nothing does
    while (low < high) {
        const uint32_t middle = (low + high) / 2;
        if (settled(middle))
            high = middle;
        else
            low = middle + 1;
    }
    settled(high);
}

MeshCut Model::cut(const CutRequest& request, Budget& budget) {
    if (const std::string fault = load(budget); !fault.empty())
        throw InputError(reader_.path(), "", "the model is damaged: " + fault);
    const double finest = double(reader_.info().quantisation_error);
    auto adaption = std::make_unique<Adaption>(mesh_);
    if (request.max_triangles)
        refineTo(*request.max_triangles, adaption);
    else if (request.view && request.pixels > 0)
        adaption->settle(criterionOf(*request.view, mesh_.lattice, request.pixels));
    else
        adaption->settle(
            criterionOf(request.max_error ? *request.max_error - finest : -1.0, mesh_.lattice));
    MeshCut cut = toCut(adaption->mesh());
    cut.below_finest = request.max_error && cut.max_error > *request.max_error;
    cut.over_budget = request.max_triangles && cut.mesh.triangleCount() > *request.max_triangles;
    return cut;
}

}  // namespace

NodeForest openForest(const ModelReader& reader) {
    const auto damaged = [&](const std::string& what) {
        throw InputError(reader.path(), "", "the model is damaged: " + what);
    };
    const uint32_t format = reader.identity().method_format;
    if (format > kMethodFormat)
        throw InputError(reader.path(), "",
                         fmt::format("version {} of pmesh is unknown, this program reads up to "
                                     "version {}",
                                     format, kMethodFormat));
    NodeForest forest;
    forest.lattice = reader.info().lattice;
    forest.layout = WordLayout::of(reader.info().schema);
    forest.row = rowsOf(reader.nodes(), forest.lattice.shift);
    if (reader.pageCount() != forest.row.size()) damaged("a page has several nodes");
    std::string fault;
    if (!decodeBase(reader.methodSection(), format, forest, fault))
        damaged("its base mesh: " + fault);
    return forest;
}

std::string readNode(const ModelReader& reader, const NodeForest& forest, NodeIndex index,
                     OperationNode& node) {
    thread_local std::vector<std::byte> bytes;
    std::string fault;
    if (!reader.tryReadPage(index, bytes, fault)) return fault;
    if (decodeNode(bytes, index, forest.row[index], forest.layout, node, fault)) return "";
    return fmt::format("page {} is damaged: {}", index, fault);
}

std::unique_ptr<AdaptiveModel> openModel(const ModelReader& reader) {
    return std::make_unique<Model>(reader);
}

}  // namespace pietra::pmesh
