#include "io/formats.h"

#include "io/gltf_source.h"
#include "io/obj_source.h"
#include "io/ply_source.h"
#include "io/stl_source.h"

namespace pietra {

namespace {

constexpr MeshFormat kFormats[] = {
    {"PLY", isPly, openPly},
    {"STL", isStl, openStl},
    {"glTF", isGltf, openGltf},
    // Last, as it has no sign of its own.
    {"OBJ", isObj, openObj},
};

}  // namespace

std::span<const MeshFormat> meshFormats() {
    return kFormats;
}

}  // namespace pietra
