#pragma once
// What `check` does with a model whose pages are not patches (multires/adaptive_model.h): every
// page and what lies between pages; the model as a whole; seeded cuts, which must have the topology
// of the coarsest; and the certificate: of cuts by error, from the finest to the coarsest, and of
// the seeded ones, every triangle by what is stated of it, against the input or, without one, the
// finest cut.

#include "audit/model_check.h"
#include "multires/adaptive_model.h"

namespace pietra {

/// As checkModel(). Throws MemoryError where the model as a whole does not fit the budget.
ModelCheckReport checkAdaptive(const ModelReader& reader, AdaptiveModel& model,
                               const ModelCheckSettings& settings, Budget& budget,
                               Progress& progress);

}  // namespace pietra
