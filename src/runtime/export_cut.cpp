#include "runtime/export_cut.h"

#include <algorithm>

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

/// Vertices on their way into a file.
class VertexOutput {
public:
    VertexOutput(const ModelInfo& model, MeshWriter& writer)
        : lattice_(model.lattice), schema_(model.schema), writer_(writer) {}

    void append(const Mesh& mesh, uint32_t v) {
        batch_.position.push_back(lattice_.toInput(mesh.position[v]));
        if (schema_.normals_given) batch_.normal.push_back(decodeNormal(mesh.normal[v]));
        if (schema_.colours) batch_.colour.push_back(mesh.colour[v]);
        const size_t scalars = schema_.scalars.size();
        const auto first = mesh.scalar.begin() + std::ptrdiff_t(v * scalars);
        batch_.scalar.insert(batch_.scalar.end(), first, first + std::ptrdiff_t(scalars));
    }

    void flush() {
        writer_.addVertices(batch_);
        batch_.position.clear();
        batch_.normal.clear();
        batch_.colour.clear();
        batch_.scalar.clear();
    }

private:
    const Lattice& lattice_;
    const AttributeSchema& schema_;
    MeshWriter& writer_;
    VertexBatch batch_;
};

class Exporter {
public:
    Exporter(const ModelInfo& model, VertexNumbering& numbering, MeshWriter& writer)
        : numbering_(numbering), writer_(writer), vertices_(model, writer) {}

    void note(const Mesh& mesh) {
        used_.find(mesh);
        numbering_.note(used_.positions);
    }

    void write(const Mesh& mesh) {
        used_.find(mesh);
        numbering_.number(used_.positions, number_);
        uint64_t next = writer_.vertexCount();
        for (size_t i = 0; i < number_.size(); ++i) {
            if (number_[i] != next) continue;
            ++next;
            vertices_.append(mesh, used_.vertices[i]);
        }
        triangles_.clear();
        for (const Triangle& t : mesh.triangle)
            triangles_.push_back(
                {number_[used_.rank[t[0]]], number_[used_.rank[t[1]]], number_[used_.rank[t[2]]]});
        vertices_.flush();
        writer_.addTriangles(triangles_);
    }

private:
    VertexNumbering& numbering_;
    MeshWriter& writer_;
    VertexOutput vertices_;
    UsedVertices used_;
    std::vector<uint64_t> number_;
    std::vector<std::array<uint64_t, 3>> triangles_;
};

uint64_t verticesOf(const ModelReader& model, const Cut& cut) {
    uint64_t vertices = 0;
    for (const NodeIndex node : cut.nodes) vertices += model.nodes()[node].vertices;
    return vertices;
}

}  // namespace

MeshOutput meshOutputOf(const ModelInfo& info, uint64_t triangles) {
    Box3d box;
    box.add(info.lattice.toInput(info.bounds.min));
    box.add(info.lattice.toInput(info.bounds.max));
    MeshOutput output;
    output.schema = info.schema;
    output.double_positions = needsDoubles(box, info.lattice.vertexStep());
    output.centre = 0.5 * (box.min + box.max);
    output.expected_triangles = triangles;
    output.comment = "extracted by pietra";
    return output;
}

ExportReport exportCut(const ModelReader& model, const Cut& cut, MeshWriter& writer,
                       const ExportSettings& settings, Budget& budget, Progress& progress) {
    VertexNumbering numbering(budget, budget.available() / 2, settings.temp_dir,
                              verticesOf(model, cut));
    Exporter exporter(model.info(), numbering, writer);
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

ExportReport exportMesh(const ModelInfo& model, const Mesh& mesh, MeshWriter& writer,
                        Progress& progress) {
    constexpr size_t kBatch = 1 << 16;
    VertexOutput vertices(model, writer);
    for (size_t begin = 0; begin < mesh.vertexCount(); begin += kBatch) {
        const size_t end = std::min(begin + kBatch, mesh.vertexCount());
        for (size_t v = begin; v < end; ++v) vertices.append(mesh, uint32_t(v));
        vertices.flush();
        progress.tick(0);
    }
    std::vector<std::array<uint64_t, 3>> triangles;
    for (size_t begin = 0; begin < mesh.triangleCount(); begin += kBatch) {
        triangles.clear();
        for (size_t t = begin; t < std::min(begin + kBatch, mesh.triangleCount()); ++t)
            triangles.push_back({mesh.triangle[t][0], mesh.triangle[t][1], mesh.triangle[t][2]});
        writer.addTriangles(triangles);
        progress.tick(0);
    }
    writer.finish();
    return {writer.triangleCount(), writer.vertexCount()};
}

}  // namespace pietra
