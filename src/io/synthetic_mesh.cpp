#include "io/synthetic_mesh.h"

#include <algorithm>

#include "base/parallel.h"

namespace pietra {

namespace {

constexpr size_t kGrain = 4096;

class SyntheticSource : public TriangleSource {
public:
    explicit SyntheticSource(std::unique_ptr<const SyntheticMesh> mesh) : mesh_(std::move(mesh)) {}

    const AttributeSchema& schema() const override { return mesh_->schema(); }
    uint64_t vertexCount() override { return mesh_->vertexCount(); }
    uint64_t triangleCountHint() override { return mesh_->triangleCount(); }
    uint64_t inputBytes() const override { return 0; }
    bool cheapToReread() const override { return false; }
    std::vector<std::string> notes() const override { return {}; }

    void rewindVertices() override { next_vertex_ = 0; }
    bool readVertices(VertexBatch& batch) override {
        const auto count =
            size_t(std::min<uint64_t>(kMaxBatch, mesh_->vertexCount() - next_vertex_));
        batch.first = next_vertex_;
        batch.position.resize(count);
        batch.normal.resize(schema().normals_given ? count : 0);
        batch.colour.resize(schema().colours ? count : 0);
        batch.scalar.resize(schema().scalars.size() * count);
        parallelForSlices(count, kGrain, [&](size_t begin, size_t end) {
            mesh_->makeVertices(next_vertex_ + begin, begin, end - begin, batch);
        });
        next_vertex_ += count;
        return count > 0;
    }

    void rewindTriangles() override { next_triangle_ = 0; }
    bool readTriangles(TriangleBatch& batch) override {
        const auto count =
            size_t(std::min<uint64_t>(kMaxBatch, mesh_->triangleCount() - next_triangle_));
        batch.first = next_triangle_;
        batch.triangle.resize(count);
        parallelForSlices(count, kGrain, [&](size_t begin, size_t end) {
            mesh_->makeTriangles(next_triangle_ + begin,
                                 std::span(batch.triangle).subspan(begin, end - begin));
        });
        next_triangle_ += count;
        return count > 0;
    }

private:
    std::unique_ptr<const SyntheticMesh> mesh_;
    uint64_t next_vertex_ = 0;
    uint64_t next_triangle_ = 0;
};

}  // namespace

std::unique_ptr<TriangleSource> sourceOf(std::unique_ptr<const SyntheticMesh> mesh) {
    return std::make_unique<SyntheticSource>(std::move(mesh));
}

void copyMesh(TriangleSource& source, MeshWriter& writer, Progress& progress) {
    VertexBatch vertices;
    source.rewindVertices();
    while (source.readVertices(vertices)) {
        writer.addVertices(vertices);
        progress.tick(vertices.position.size());
    }
    writer.endVertices();
    TriangleBatch triangles;
    source.rewindTriangles();
    while (source.readTriangles(triangles)) {
        writer.addTriangles(triangles.triangle);
        progress.tick(triangles.triangle.size());
    }
}

}  // namespace pietra
