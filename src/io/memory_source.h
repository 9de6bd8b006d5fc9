#pragma once
// A triangle source over arrays in memory, for small meshes that Pietra makes itself.

#include <algorithm>
#include <array>
#include <vector>

#include "io/triangle_source.h"

namespace pietra {

class MemorySource : public TriangleSource {
public:
    MemorySource(std::vector<Vec3d> positions, std::vector<std::array<uint64_t, 3>> triangles)
        : triangles_(std::move(triangles)) {
        vertices_.position = std::move(positions);
    }
    /// With attributes: `vertices` whole, as the schema says.
    MemorySource(AttributeSchema schema, VertexBatch vertices,
                 std::vector<std::array<uint64_t, 3>> triangles)
        : schema_(std::move(schema)),
          vertices_(std::move(vertices)),
          triangles_(std::move(triangles)) {}

    const AttributeSchema& schema() const override { return schema_; }
    uint64_t vertexCount() override { return vertices_.position.size(); }
    uint64_t triangleCountHint() override { return triangles_.size(); }
    uint64_t inputBytes() const override { return 0; }
    bool cheapToReread() const override { return true; }
    std::vector<std::string> notes() const override { return {}; }

    void rewindVertices() override { next_vertex_ = 0; }
    bool readVertices(VertexBatch& batch) override {
        const size_t begin = next_vertex_;
        const size_t end = std::min(begin + kMaxBatch, vertices_.position.size());
        const auto part = [&](auto& to, const auto& from, size_t width) {
            to.clear();
            if (!from.empty())
                to.assign(from.begin() + ptrdiff_t(begin * width),
                          from.begin() + ptrdiff_t(end * width));
        };
        batch.first = begin;
        part(batch.position, vertices_.position, 1);
        part(batch.normal, vertices_.normal, 1);
        part(batch.colour, vertices_.colour, 1);
        part(batch.scalar, vertices_.scalar, schema_.scalars.size());
        next_vertex_ = end;
        return begin < end;
    }
    void rewindTriangles() override { next_triangle_ = 0; }
    bool readTriangles(TriangleBatch& batch) override {
        const size_t begin = next_triangle_;
        const size_t end = std::min(begin + kMaxBatch, triangles_.size());
        batch.first = begin;
        batch.triangle.assign(triangles_.begin() + ptrdiff_t(begin),
                              triangles_.begin() + ptrdiff_t(end));
        next_triangle_ = end;
        return begin < end;
    }

private:
    AttributeSchema schema_;
    VertexBatch vertices_;
    std::vector<std::array<uint64_t, 3>> triangles_;
    size_t next_vertex_ = 0, next_triangle_ = 0;
};

}  // namespace pietra
