#pragma once
// `build --method pmesh`, out of core: leaves as for every construction; collapses by diamonds, on
// all cores; then packed into nodes, encoded and written. Collapses, slots and pages lie in
// temporary space. What grows with the input are tables: of names, four bytes a vertex; of nodes;
// and of the vertices on the borders of diamonds. MemoryError where the limit is less.

#include "multires/method.h"

namespace pietra::pmesh {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress);

}  // namespace pietra::pmesh
