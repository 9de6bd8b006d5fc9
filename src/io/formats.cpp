#include "io/formats.h"

#include "io/ply_source.h"
#include "io/stl_source.h"

namespace pietra {

namespace {

constexpr MeshFormat kFormats[] = {
    {"PLY", isPly, openPly},
    {"STL", isStl, openStl},
};

}  // namespace

std::span<const MeshFormat> meshFormats() {
    return kFormats;
}

}  // namespace pietra
