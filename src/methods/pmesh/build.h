#pragma once
// `build --method pmesh`: the whole input onto the lattice, one simplification, its collapses as
// nodes of operations into a file. In memory so far (in_core_builder.h): MemoryError, with the size
// needed, where the limit is less.

#include "multires/method.h"

namespace pietra::pmesh {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress);

}  // namespace pietra::pmesh
