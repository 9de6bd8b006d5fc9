#pragma once
// Makes a large mesh of a small one: every triangle is cut into four, again and again, and each new
// vertex is moved along the surface's normal by a hash of where it lies, up to a share of the edge
// it halves (midpoint displacement). So the relief has one octave a level, and simplifies about as
// hard as a scan does.
//
// Vertices of equal position are one: neighbours agree exactly, and what was closed stays closed,
// without a vertex twice. Triangles with two equal corners are dropped. Colours and scalars are
// interpolated, normals of the input are left out. Memory: some 150 bytes a vertex of the *input*,
// whatever `levels` is (and 4^levels * 40 bytes for one triangle's worth). The output's order
// follows the input's.

#include <cstdint>
#include <memory>

#include "io/triangle_source.h"

namespace pietra {

inline constexpr int kMaxSubdivideLevels = 10;

struct SubdivideSettings {
    int levels = 1;             ///< 0 to kMaxSubdivideLevels
    double displacement = 0.2;  ///< largest displacement over the length of the edge halved
    uint64_t seed = 1;
};

/// `input` must outlive the result, which reads it again for each of its streams.
std::unique_ptr<TriangleSource> subdivide(TriangleSource& input, const SubdivideSettings& settings);

}  // namespace pietra
