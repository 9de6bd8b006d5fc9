#pragma once
// The one way by which a mesh enters Pietra: a stream of vertices and a stream of triangles that
// refer to them by index, in bounded memory, whatever the file format.
//
// A source is opened by openSource(). Each of the two streams can be read from its start any number
// of times, in any order, one stream at a time. Polygons come out as triangles (fans, also of
// concave ones, which notes() counts), strips as triangles with the right orientation. Batches are
// as large as the source likes, at most kMaxBatch elements. Not thread-safe. Faults throw
// InputError or IoError.

#include <array>
#include <cstdint>
#include <memory>
#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace pietra {

/// A run of consecutive vertices, structure of arrays.
struct VertexBatch {
    uint64_t first = 0;           ///< index of the first one
    std::vector<Vec3d> position;  ///< input coordinates; finite (the source has checked)
    std::vector<Vec3f> normal;    ///< as in the file, or empty
    std::vector<Rgba8> colour;    ///< or empty
    std::vector<float> scalar;    ///< vertex-major, schema.scalars.size() a vertex, or empty

    /// Empty, keeping its capacity; what follows begins at vertex number `first`.
    void restart(uint64_t first_vertex) {
        first = first_vertex;
        position.clear();
        normal.clear();
        colour.clear();
        scalar.clear();
    }
};

struct TriangleBatch {
    uint64_t first = 0;                             ///< number of the first triangle
    std::vector<std::array<uint64_t, 3>> triangle;  ///< indices, all below vertexCount()
};

inline constexpr size_t kMaxBatch = 1 << 16;

class TriangleSource {
public:
    virtual ~TriangleSource() = default;

    virtual const AttributeSchema& schema() const = 0;
    /// Exact. May scan the file the first time it is called.
    virtual uint64_t vertexCount() = 0;
    /// What is known before reading, such as the file's own count of faces: for progress and sizes,
    /// not exact where there are polygons or strips.
    virtual uint64_t triangleCountHint() = 0;
    /// Size of the input files in bytes (compressed size for compressed ones).
    virtual uint64_t inputBytes() const = 0;
    /// True where reading the vertices a second time costs no more than reading a binary file.
    virtual bool cheapToReread() const = 0;
    /// Sentences about what was left out or repaired ("texture coordinates are left out"), complete
    /// once both streams have been read.
    virtual std::vector<std::string> notes() const = 0;

    virtual void rewindVertices() = 0;
    /// False at the end; `batch` is then empty. Overwrites `batch`, keeping its capacity.
    virtual bool readVertices(VertexBatch& batch) = 0;
    virtual void rewindTriangles() = 0;
    virtual bool readTriangles(TriangleBatch& batch) = 0;
};

/// Opens one or several files as one model, by content (magic bytes), not by name alone. Pipes, and
/// packed files of a format that is read in turns (glTF), are copied to temporary files in the
/// folder `temp_dir`. Throws IoError (cannot open), InputError (no known format, bad header).
std::unique_ptr<TriangleSource> openSource(const std::vector<std::string>& paths,
                                           const std::string& temp_dir = ".");
/// Throws what openSource() throws where a file is of no known format, also for a pipe, which a
/// later openSource() would find empty. Reads the first bytes alone.
void checkMeshFormat(const std::string& path);

}  // namespace pietra
