#pragma once
// What Pietra needs of the JSON of a glTF 2.0 file, as plain arrays: each object of the JSON
// becomes one entry as it is parsed and is forgotten, so memory is some times the text without the
// data in its strings (gltf_text.h), whatever the text says.
//
// Entries are right in themselves: what they say of each other (indices, sizes) is checked where it
// is used. Faults are InputErrors with the place in the JSON ("accessors[3].count") or the byte.

#include <array>
#include <cstdint>
#include <glm/mat4x4.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "io/byte_reader.h"

namespace pietra {

/// An index that is not given.
inline constexpr uint32_t kGltfNone = UINT32_MAX;

struct GltfBuffer {
    uint64_t bytes = 0;
    std::optional<std::string> uri;  ///< data may stand elsewhere, see gltf_text.h
};

struct GltfView {
    uint32_t buffer = 0;
    uint32_t stride = 0;  ///< 0: elements are packed
    uint64_t offset = 0, bytes = 0;
};

enum class GltfComponent : uint16_t {
    kInt8 = 5120,
    kUint8 = 5121,
    kInt16 = 5122,
    kUint16 = 5123,
    kUint32 = 5125,
    kFloat = 5126
};

size_t bytesOf(GltfComponent component);

struct GltfSparse {
    uint64_t count = 0;
    uint32_t index_view = 0, value_view = 0;
    uint64_t index_offset = 0, value_offset = 0;
    GltfComponent index_component = GltfComponent::kUint32;
};

struct GltfAccessor {
    uint32_t view = kGltfNone;
    uint32_t sparse = kGltfNone;  ///< index into GltfDocument::sparse
    uint64_t offset = 0, count = 0;
    GltfComponent component = GltfComponent::kFloat;
    bool normalized = false;
    uint8_t components = 0;  ///< 1 to 4; 0 for matrices
};

struct GltfPrimitive {
    static constexpr uint8_t kTriangles = 4, kStrip = 5, kFan = 6;
    uint8_t mode = kTriangles;
    uint32_t indices = kGltfNone, position = kGltfNone, normal = kGltfNone, colour = kGltfNone;
    std::vector<std::pair<std::string, uint32_t>> custom;  ///< "_NAME" and accessor, by name
};

struct GltfMesh {
    std::vector<GltfPrimitive> primitives;
};

struct GltfNode {
    uint32_t mesh = kGltfNone;
    uint32_t transform = kGltfNone;  ///< index into GltfDocument::transforms; none: identity
    std::vector<uint32_t> children;
};

/// What a file has and Pietra leaves out.
enum class GltfLeftOut : uint8_t {
    kTextureCoordinates,
    kTangents,
    kMoreColours,
    kMaterials,
    kTextures,
    kSkins,
    kMorphTargets,
    kAnimations,
    kGpuInstances,
    kCount
};

struct GltfDocument {
    std::vector<GltfBuffer> buffers;
    std::vector<GltfView> views;
    std::vector<GltfAccessor> accessors;
    std::vector<GltfSparse> sparse;
    std::vector<GltfMesh> meshes;
    std::vector<GltfNode> nodes;
    std::vector<glm::dmat4> transforms;
    std::vector<std::vector<uint32_t>> scenes;  ///< their root nodes
    std::optional<uint64_t> scene;
    std::array<bool, size_t(GltfLeftOut::kCount)> left_out{};
    std::vector<std::string> unknown;  ///< extensions that the file uses without requiring them

    /// What to say where data is missing: " (...)" with those that may have it, or "".
    std::string whyMissing() const;
};

/// Parses the JSON at [begin, end) of the file. Throws InputError, also for another version and for
/// required extensions that Pietra does not know.
GltfDocument readGltfDocument(ByteReader& reader, uint64_t begin, uint64_t end);

}  // namespace pietra
