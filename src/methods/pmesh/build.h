#pragma once
// `build --method pmesh`: leaves as for every construction out of core; collapses by diamonds, on
// all cores; then packed, encoded and written. Encoding still has the whole mesh in memory:
// MemoryError, with the size needed, where the limit is less.

#include "multires/method.h"

namespace pietra::pmesh {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress);

}  // namespace pietra::pmesh
