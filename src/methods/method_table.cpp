#include "methods/method_table.h"

#include <fmt/format.h>

#include "base/error.h"
#include "methods/cluster/build.h"
#include "methods/pmesh/build.h"
#include "methods/pmesh/front/split_live.h"
#include "methods/pmesh/split_model.h"
#include "methods/tetra/build.h"

namespace pietra {

namespace {

constexpr Method kMethods[] = {
    {"tetra", "Adaptive TetraPuzzles: patches in a hierarchy of tetrahedra", tetra::build, true,
     nullptr},
    {"pmesh", "progressive mesh: refined vertex by vertex, in fewer triangles", pmesh::build, true,
     pmesh::openModel, pmesh::openLive},
    {"cluster", "octree and face clusters: every cell at the layer it likes", cluster::build, true,
     nullptr},
};

const Method& methodOf(const ModelReader& reader) {
    const Method* method = findMethod(reader.info().method);
    if (!method || !method->open)
        throw InputError(
            reader.path(), "",
            fmt::format("its method, {}, is unknown to this program", reader.info().method));
    return *method;
}

}  // namespace

std::span<const Method> methods() {
    return kMethods;
}

std::unique_ptr<AdaptiveModel> openAdaptive(const ModelReader& reader) {
    return reader.hasPatches() ? nullptr : methodOf(reader).open(reader);
}

std::unique_ptr<LiveModel> openLive(const ModelReader& reader) {
    return reader.hasPatches() ? nullptr : methodOf(reader).open_live(reader);
}

bool provesErrors(const ModelInfo& info) {
    const Method* method = findMethod(info.method);
    return method && method->proven;
}

const Method* findMethod(std::string_view name) {
    for (const Method& method : kMethods)
        if (name == method.name) return &method;
    return nullptr;
}

}  // namespace pietra
