#include "runtime/export_cut.h"

#include "runtime/patch_reader.h"
#include "runtime/vertex_numbering.h"

namespace pietra {

namespace {

constexpr uint32_t kUnused = ~uint32_t(0);

/// The vertices of a patch that its triangles use, in their order. Scratch for both rounds, which
/// must see the same.
class UsedVertices {
public:
    std::vector<uint32_t> vertices;  ///< in the patch
    std::vector<uint32_t> rank;      ///< in `vertices` of each vertex of the patch, or kUnused
    std::vector<Vec3i> positions;    ///< of `vertices`

    void find(const Mesh& mesh) {
        rank.assign(mesh.vertexCount(), kUnused);
        for (const Triangle& t : mesh.triangle)
            for (const uint32_t v : t) rank[v] = 0;
        vertices.clear();
        positions.clear();
        for (uint32_t v = 0; v < rank.size(); ++v) {
            if (rank[v] == kUnused) continue;
            rank[v] = uint32_t(vertices.size());
            vertices.push_back(v);
            positions.push_back(mesh.position[v]);
        }
    }
};

class Exporter {
public:
    Exporter(const ModelReader& model, VertexNumbering& numbering, MeshWriter& writer)
        : lattice_(model.info().lattice),
          schema_(model.info().schema),
          numbering_(numbering),
          writer_(writer) {}

    void note(const Mesh& mesh) {
        used_.find(mesh);
        numbering_.note(used_.positions);
    }

    void write(const Mesh& mesh) {
        used_.find(mesh);
        numbering_.number(used_.positions, number_);
        clearBatch();
        uint64_t next = writer_.vertexCount();
        for (size_t i = 0; i < number_.size(); ++i) {
            if (number_[i] != next) continue;
            ++next;
            append(mesh, used_.vertices[i]);
        }
        triangles_.clear();
        for (const Triangle& t : mesh.triangle)
            triangles_.push_back(
                {number_[used_.rank[t[0]]], number_[used_.rank[t[1]]], number_[used_.rank[t[2]]]});
        writer_.addVertices(batch_);
        writer_.addTriangles(triangles_);
    }

private:
    void clearBatch() {
        batch_.position.clear();
        batch_.normal.clear();
        batch_.colour.clear();
        batch_.scalar.clear();
    }

    void append(const Mesh& mesh, uint32_t v) {
        batch_.position.push_back(lattice_.toInput(mesh.position[v]));
        if (schema_.normals_given) batch_.normal.push_back(decodeNormal(mesh.normal[v]));
        if (schema_.colours) batch_.colour.push_back(mesh.colour[v]);
        const size_t scalars = schema_.scalars.size();
        const auto first = mesh.scalar.begin() + std::ptrdiff_t(v * scalars);
        batch_.scalar.insert(batch_.scalar.end(), first, first + std::ptrdiff_t(scalars));
    }

    const Lattice& lattice_;
    const AttributeSchema& schema_;
    VertexNumbering& numbering_;
    MeshWriter& writer_;
    UsedVertices used_;
    std::vector<uint64_t> number_;
    std::vector<std::array<uint64_t, 3>> triangles_;
    VertexBatch batch_;
};

uint64_t verticesOf(const ModelReader& model, const Cut& cut) {
    uint64_t vertices = 0;
    for (const NodeIndex node : cut.nodes) vertices += model.nodes()[node].vertices;
    return vertices;
}

}  // namespace

MeshOutput meshOutputOf(const ModelReader& model, const Cut& cut) {
    const ModelInfo& info = model.info();
    Box3d box;
    box.add(info.lattice.toInput(info.bounds.min));
    box.add(info.lattice.toInput(info.bounds.max));
    MeshOutput output;
    output.schema = info.schema;
    output.double_positions = needsDoubles(box, info.lattice.vertexStep());
    output.centre = 0.5 * (box.min + box.max);
    output.expected_triangles = cut.triangles;
    output.comment = "extracted by pietra";
    output.expected_triangles = cut.triangles;
    return output;
}

ExportReport exportCut(const ModelReader& model, const Cut& cut, MeshWriter& writer,
                       const ExportSettings& settings, Budget& budget, Progress& progress) {
    VertexNumbering numbering(budget, budget.available() / 2, settings.temp_dir,
                              verticesOf(model, cut));
    Exporter exporter(model, numbering, writer);
    const auto forEachPatch = [&](auto&& visit) {
        visitInOrder(model, cut.nodes, settings.in_flight, [&](DecodedRun& run) {
            for (const Mesh& mesh : run.patches) visit(mesh);
            progress.tick(run.patches.size());
        });
    };
    forEachPatch([&](const Mesh& mesh) { exporter.note(mesh); });
    numbering.finishNoting();
    forEachPatch([&](const Mesh& mesh) { exporter.write(mesh); });
    writer.finish();
    return {writer.triangleCount(), writer.vertexCount()};
}

}  // namespace pietra
