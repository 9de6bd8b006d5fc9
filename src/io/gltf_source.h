#pragma once
// glTF 2.0 (.gltf, .glb) as a TriangleSource: the triangles, strips and fans of a scene, as its
// nodes place them (gltf_scene.h), in the file's own axes, where y is up. Positions and products of
// matrices are doubles. Mirrored instances are turned round, so that outside stays outside.
//
// Normals are turned by the inverse transpose; COLOR_0 becomes bytes as it stands there (no change
// of colour space; white where a primitive has none); attributes _NAME that are scalars become
// scalars NAME, in the order of their names. Data that the file does not hold, such as by required
// extensions, is an error; looks and movement are left out with a note.
//
// Memory: the JSON's entries, some windows of 256 KiB and the caller's batch. Packed files, also
// those beside it, are copied to temporary ones, for their parts are read in turns.

#include <memory>

#include "io/byte_reader.h"
#include "io/file_signs.h"
#include "io/triangle_source.h"

namespace pietra {

bool isGltf(const FileSigns& signs);

/// Throws InputError, or IoError where a file beside it cannot be read.
std::unique_ptr<TriangleSource> openGltf(std::unique_ptr<ByteReader> reader);

}  // namespace pietra
