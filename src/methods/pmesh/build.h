#pragma once
// `build --method pmesh`, out of core: leaves as for every construction; collapses by diamonds, on
// all cores; then packed into nodes, encoded and written. Collapses, slots and pages lie in
// temporary space. What grows with the input is 8 bytes a vertex, and while collapsing some 50
// (diamond_collapses.h): MemoryError where the limit is less.

#include "multires/method.h"

namespace pietra::pmesh {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress);

}  // namespace pietra::pmesh
