#pragma once
// Writes a mesh to a file as it comes, in bounded memory: .ply, .obj, .stl and .glb.
//
// Counts need not be known. Vertices and triangles may come in turns; a triangle's vertices come
// before it. The file appears under its name only when finish() returns: until then, and when the
// writer is dropped without it, there is nothing (temporary files have no name or are removed).
//
//   .ply  binary little-endian; float or double positions, normals, colours, scalars
//   .obj  text; positions with every digit that matters, normals, colours as "v x y z r g b"
//   .stl  binary; float positions, normals of the triangles
//   .glb  glTF 2.0; float positions relative to a node's translation, 32-bit indices, normals,
//         COLOR_0, scalars as _NAME; below 4 GiB
//
// Bytes depend on what is written alone. Memory: some MiB. Disk: .ply and .glb keep triangles in a
// temporary file beside the output while vertices may still come, .stl the vertices. Faults:
// UsageError (unknown ending, file exists, too large for the format), IoError. Not thread-safe.

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "geometry/bounds.h"
#include "io/triangle_source.h"

namespace pietra {

struct MeshOutput {
    /// Attributes that every vertex batch brings; `normals_given`: normals are written.
    AttributeSchema schema;
    /// Positions need more than floats (see needsDoubles()). Ignored by .stl and .glb.
    bool double_positions = false;
    /// A point amid the mesh; .glb stores positions relative to it.
    Vec3d centre{0, 0, 0};
    /// One line on where the mesh comes from, or "". Not for .stl.
    std::string comment;
    /// Counts, or lower bounds of them, where they are known before: what the format cannot hold is
    /// then refused at once, and not when the file is full.
    uint64_t expected_vertices = 0;
    uint64_t expected_triangles = 0;
};

class MeshWriter {
public:
    virtual ~MeshWriter() = default;

    /// Appends vertices; `batch.first` is ignored: they are numbered as they come.
    void addVertices(const VertexBatch& batch);
    /// No more vertices will come. Optional: it saves the way through the temporary file.
    virtual void endVertices() {}
    /// Appends triangles of vertices that are there already.
    void addTriangles(std::span<const std::array<uint64_t, 3>> triangles);
    /// Completes the file and gives it its name.
    virtual void finish() = 0;

    uint64_t vertexCount() const { return vertices_; }
    uint64_t triangleCount() const { return triangles_; }
    /// Sentences about what the format cannot hold.
    virtual std::vector<std::string> notes() const { return {}; }

protected:
    explicit MeshWriter(const MeshOutput& output) : output_(output) {}
    /// Throws UsageError where the format cannot hold that many.
    virtual void checkCounts(uint64_t vertices, uint64_t triangles) const = 0;
    virtual void putVertices(const VertexBatch& batch) = 0;
    virtual void putTriangles(std::span<const std::array<uint64_t, 3>> triangles) = 0;
    const MeshOutput output_;

private:
    uint64_t vertices_ = 0;
    uint64_t triangles_ = 0;
};

/// The format is chosen by the ending of `path`. `force`: an existing file is replaced.
std::unique_ptr<MeshWriter> createMesh(const std::string& path, bool force,
                                       const MeshOutput& output);

/// Whether floats would move points within `bounds` by more than a quarter of `step`, the spacing
/// of vertices that matters.
bool needsDoubles(const Box3d& bounds, double step);

}  // namespace pietra
