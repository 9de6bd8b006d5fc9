#pragma once
// The synthetic shapes: sphere, statue, terrain.

#include <cstdint>
#include <memory>

#include "io/synthetic_mesh.h"

namespace pietra {

/// The unit sphere, closed, of `triangles` triangles, or nearly so many, of nearly equal size (8 n
/// k with n <= k <= 1.5 n: an octahedron whose edges are cut into n, with a belt); no attributes.
std::unique_ptr<const SyntheticMesh> makeSphere(uint64_t triangles);

/// A bust some two units high on a plinth, closed, with folds and chisel marks down to the size of
/// the triangles; `seed` chooses which. As many triangles as makeSphere(); no attributes.
std::unique_ptr<const SyntheticMesh> makeStatue(uint64_t triangles, uint64_t seed);

/// Fractal terrain over a square of 1000 by 1000, z up, an open surface of 2 n^2 triangles: ridges
/// and plains with detail down to the size of the triangles; colours by height and the scalar
/// `height`.
std::unique_ptr<const SyntheticMesh> makeTerrain(uint64_t triangles, uint64_t seed);

}  // namespace pietra
