#pragma once
// A triangle source over arrays in memory, for small meshes that Pietra makes itself, above all in
// tests. Batches are small, so that also these meshes come in several.

#include <algorithm>
#include <array>
#include <utility>
#include <vector>

#include "base/hash.h"
#include "io/triangle_source.h"

namespace pietra {

class MemorySource : public TriangleSource {
public:
    using Index = std::array<uint64_t, 3>;

    MemorySource() = default;
    MemorySource(std::vector<Vec3d> positions, std::vector<Index> triangle_list)
        : triangles(std::move(triangle_list)) {
        vertices.position = std::move(positions);
    }
    /// With attributes: `all_vertices` as the schema says.
    MemorySource(AttributeSchema schema, VertexBatch all_vertices, std::vector<Index> triangle_list)
        : attributes(std::move(schema)),
          vertices(std::move(all_vertices)),
          triangles(std::move(triangle_list)) {}

    const AttributeSchema& schema() const override { return attributes; }
    uint64_t vertexCount() override { return vertices.position.size(); }
    uint64_t triangleCountHint() override { return triangles.size(); }
    uint64_t inputBytes() const override { return 0; }
    bool cheapToReread() const override { return true; }
    std::vector<std::string> notes() const override { return {}; }

    void rewindVertices() override { next_vertex_ = 0; }
    bool readVertices(VertexBatch& batch) override {
        const size_t begin = next_vertex_;
        const size_t end = std::min(begin + kBatch, vertices.position.size());
        const auto part = [&](auto& to, const auto& from, size_t width) {
            to.clear();
            if (!from.empty())
                to.assign(from.begin() + ptrdiff_t(begin * width),
                          from.begin() + ptrdiff_t(end * width));
        };
        batch.first = begin;
        part(batch.position, vertices.position, 1);
        part(batch.normal, vertices.normal, 1);
        part(batch.colour, vertices.colour, 1);
        part(batch.scalar, vertices.scalar, attributes.scalars.size());
        next_vertex_ = end;
        return begin < end;
    }
    void rewindTriangles() override { next_triangle_ = 0; }
    bool readTriangles(TriangleBatch& batch) override {
        const size_t begin = next_triangle_;
        const size_t end = std::min(begin + kBatch, triangles.size());
        batch.first = begin;
        batch.triangle.assign(triangles.begin() + ptrdiff_t(begin),
                              triangles.begin() + ptrdiff_t(end));
        next_triangle_ = end;
        return begin < end;
    }

    /// Puts the triangles in an order without any locality.
    void shuffleTriangles() {
        std::sort(triangles.begin(), triangles.end(), [](const Index& a, const Index& b) {
            return std::pair(mixBits(a[0] * 7 + a[1]), a) < std::pair(mixBits(b[0] * 7 + b[1]), b);
        });
    }

    // The mesh, to be changed at will between reads.
    AttributeSchema attributes;
    VertexBatch vertices;  ///< all of them, as `attributes` says
    std::vector<Index> triangles;

private:
    static constexpr size_t kBatch = 5000;
    size_t next_vertex_ = 0, next_triangle_ = 0;
};

}  // namespace pietra
