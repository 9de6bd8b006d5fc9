#include "io/formats.h"

#include "io/gltf_source.h"
#include "io/ply_source.h"
#include "io/stl_source.h"

namespace pietra {

namespace {

constexpr MeshFormat kFormats[] = {
    {"PLY", isPly, openPly},
    {"STL", isStl, openStl},
    {"glTF", isGltf, openGltf},
};

}  // namespace

std::span<const MeshFormat> meshFormats() {
    return kFormats;
}

}  // namespace pietra
