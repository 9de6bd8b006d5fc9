#pragma once
// Construction by octree and face clusters (Wu and Huang 2014), out of core: vertices onto the
// lattice, triangles into leaves of the octree, then layer by layer, fine to coarse. See README.md
// in this folder.

#include "multires/method.h"

namespace pietra::cluster {

BuildReport build(TriangleSource& source, const BuildSettings& settings, Progress& progress);

}  // namespace pietra::cluster
