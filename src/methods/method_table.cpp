#include "methods/method_table.h"

#include "methods/tetra/build.h"

namespace pietra {

namespace {

constexpr Method kMethods[] = {
    {"tetra", "Adaptive TetraPuzzles: patches in a hierarchy of tetrahedra", tetra::build},
};

}  // namespace

std::span<const Method> methods() {
    return kMethods;
}

const Method* findMethod(std::string_view name) {
    for (const Method& method : kMethods)
        if (name == method.name) return &method;
    return nullptr;
}

}  // namespace pietra
