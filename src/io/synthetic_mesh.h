#pragma once
// Meshes given by formulas: every vertex and triangle can be computed on its own, so a mesh of any
// size is a TriangleSource that stores nothing. They are closed or open surfaces for
// demonstrations, tests and benchmarks. Same bytes for any number of threads; no libm but sqrt.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "base/progress.h"
#include "io/mesh_writer.h"
#include "io/triangle_source.h"

namespace pietra {

class SyntheticMesh {
public:
    virtual ~SyntheticMesh() = default;
    virtual const AttributeSchema& schema() const = 0;
    virtual uint64_t vertexCount() const = 0;
    virtual uint64_t triangleCount() const = 0;
    /// Vertices first, first + 1, ... as many as the batch's arrays are long, into the batch from
    /// element `at` on, `count` of them. Thread-safe.
    virtual void makeVertices(uint64_t first, size_t at, size_t count,
                              VertexBatch& batch) const = 0;
    /// Triangles first, first + 1, ... to `out`. Thread-safe.
    virtual void makeTriangles(uint64_t first, std::span<std::array<uint64_t, 3>> out) const = 0;
};

/// A synthetic mesh as a source; batches are computed on all threads.
std::unique_ptr<TriangleSource> sourceOf(std::unique_ptr<const SyntheticMesh> mesh);

/// Writes all of `source`; the caller calls finish(). Ticks vertices and triangles.
void copyMesh(TriangleSource& source, MeshWriter& writer, Progress& progress);

}  // namespace pietra
