#pragma once
// What the fuzz targets of mesh readers require of a source, whatever its bytes.

#include <cmath>
#include <cstdlib>

#include "io/triangle_source.h"

namespace pietra {

inline void require(bool condition) {
    if (!condition) std::abort();
}

/// Reads both streams, or their beginnings: a few bytes can stand for any number of instances.
inline void readSource(TriangleSource& source) {
    constexpr uint64_t kEnough = 1 << 20;
    VertexBatch vertices;
    uint64_t vertex_count = 0;
    bool ended = false;
    source.rewindVertices();
    while (vertex_count < kEnough && !(ended = !source.readVertices(vertices))) {
        require(vertices.first == vertex_count && !vertices.position.empty());
        require(vertices.position.size() <= kMaxBatch);
        vertex_count += vertices.position.size();
        for (const Vec3d& p : vertices.position)
            require(std::isfinite(p.x) && std::isfinite(p.y) && std::isfinite(p.z));
        const AttributeSchema& schema = source.schema();
        const size_t size = vertices.position.size();
        require(vertices.normal.size() == (schema.normals_given ? size : 0));
        require(vertices.colour.size() == (schema.colours ? size : 0));
        require(vertices.scalar.size() == schema.scalars.size() * size);
    }
    if (ended) require(vertex_count == source.vertexCount());
    TriangleBatch triangles;
    uint64_t triangle_count = 0;
    source.rewindTriangles();
    while (triangle_count < kEnough && source.readTriangles(triangles)) {
        require(triangles.first == triangle_count && !triangles.triangle.empty());
        require(triangles.triangle.size() <= kMaxBatch);
        triangle_count += triangles.triangle.size();
        for (const auto& t : triangles.triangle)
            for (const uint64_t index : t) require(index < source.vertexCount());
    }
    source.notes();
}

}  // namespace pietra
