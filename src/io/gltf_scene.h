#pragma once
// What is to be drawn of a glTF file: its meshes, each as often as nodes of the scene name it.
//
// Nothing is spelled out: an instance is a mesh and a matrix, so memory goes with the text of the
// file, however often a mesh is placed. The scene is the one that the file says, else its first,
// else all nodes, else all meshes.
//
// Primitives of a mesh that name the same vertices share them. Where other meshes name them too
// (one large buffer for everything), each takes only the part that its indices reach.

#include <cstdint>
#include <glm/mat3x3.hpp>
#include <glm/mat4x4.hpp>
#include <string>
#include <vector>

#include "geometry/mesh.h"
#include "io/gltf_buffers.h"
#include "io/gltf_document.h"

namespace pietra {

/// Vertices that primitives of a mesh share: a range of rows of some accessors.
struct GltfVertexSet {
    uint32_t position = kGltfNone, normal = kGltfNone, colour = kGltfNone;
    std::vector<uint32_t> scalars;  ///< as in the schema
    uint64_t first_row = 0, count = 0;
    uint64_t first_vertex = 0;  ///< within the mesh
};

/// Triangles of a mesh that share a vertex set.
struct GltfSurface {
    uint32_t set = 0;
    uint32_t indices = kGltfNone;
    uint8_t mode = GltfPrimitive::kTriangles;
    uint64_t triangles = 0;  ///< at least one
};

struct GltfShape {
    std::vector<GltfVertexSet> sets;
    std::vector<GltfSurface> surfaces;
    uint64_t vertices = 0, triangles = 0;
};

struct GltfInstance {
    uint32_t mesh = 0;
    uint64_t first_vertex = 0;
    glm::dmat4 matrix{1};
};

struct GltfScene {
    AttributeSchema schema;
    std::vector<GltfShape> shapes;  ///< one a mesh; empty where it is not used
    std::vector<GltfInstance> instances;
    uint64_t vertices = 0, triangles = 0;
    std::vector<std::string> notes;
};

/// Checks all that is used but the elements themselves. Throws InputError, IoError.
GltfScene makeGltfScene(const GltfDocument& document, GltfBuffers& buffers);

}  // namespace pietra
