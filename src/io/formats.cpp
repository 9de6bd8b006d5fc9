#include "io/formats.h"

#include "io/obj_source.h"
#include "io/ply_source.h"

namespace pietra {

namespace {

constexpr MeshFormat kFormats[] = {
    {"PLY", isPly, openPly},
    {"OBJ", isObj, openObj},
};

}  // namespace

std::span<const MeshFormat> meshFormats() {
    return kFormats;
}

}  // namespace pietra
