#pragma once
// Construction by Adaptive TetraPuzzles (Cignoni et al. 2004, section 5), out of core: vertices
// onto the lattice, triangles into leaf cells, then level by level, fine to coarse, every diamond
// merged, simplified, bounded, saturated and written. See README.md in this folder.

#include "multires/method.h"

namespace pietra::tetra {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress);

}  // namespace pietra::tetra
