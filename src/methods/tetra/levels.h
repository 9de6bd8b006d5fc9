#pragma once
// The second phase of construction (Cignoni et al. 2004, section 5.2): from leaf cells to the
// roots, level by level. Diamonds of a level are independent and run in parallel; results are
// written in the order of the curve, so the file does not depend on who was first.

#include "coarsen/leaves.h"
#include "multires/method.h"
#include "store/model_writer.h"

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

/// Consumes the leaves.
LevelCounts buildLevels(Leaves& leaves, const LevelSettings& settings, TempSpace& space,
                        ModelWriter& writer, Progress& progress);

}  // namespace pietra::tetra
