#pragma once
// The second phase of construction (Cignoni et al. 2004, section 5.2): from leaf cells to the
// roots, level by level. Diamonds of a level are independent and run in parallel; results are
// written in the order of the curve, so the file does not depend on who was first.

#include "construction/construction.h"

namespace pietra::tetra {

struct LevelSettings {
    uint32_t patch_triangles;
    int shift;
    AttributeSchema schema;
    std::vector<float> scalar_range;  ///< over the whole input, one a scalar
    float quantisation_error;         ///< what the leaves state, lattice units
    int jobs;
};

struct LevelCounts {
    uint32_t levels = 0;
    uint64_t triangles = 0;  ///< stored, over all levels
};

/// Consumes the leaves. Goes on from the last level that was saved, where there is one.
LevelCounts buildLevels(Construction& work, const LevelSettings& settings, Progress& progress);

}  // namespace pietra::tetra
