#pragma once
// The programs that draw patches, one for each thing that a view may ask for, and what they need
// besides buffers.

#include <array>

#include "gpu/program.h"
#include "render/gl/page_format.h"
#include "render/shading.h"

namespace pietra {

/// What a program is made for: where a surface's colour is from, and what becomes of it.
enum class Look {
    kLit,
    kLitColours,
    kLitTriangles,
    kLitScalar,
    kFlat,
    kFlatColours,
    kNormals,
    kWire,
    kWireColours
};
inline constexpr size_t kLooks = 9;

/// How a patch with such vertices looks in a view.
Look lookOf(Show show, const VertexLayout& layout);

/// Whether its programs read the vertices' colours.
inline bool usesColours(Look look) {
    return look == Look::kLitColours || look == Look::kFlatColours || look == Look::kWireColours;
}

/// By Look.
std::array<GlProgram, kLooks> makeDrawPrograms(int samples);

/// scalarColour() as a texture over [0, 1].
GlTexture makeScalarColours();

}  // namespace pietra
