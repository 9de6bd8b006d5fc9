#pragma once
// What `check` does with a model whose pages are not patches (multires/adaptive_model.h): every
// page and what lies between pages; the model as a whole; seeded cuts, which must have the topology
// of the coarsest; and, with the input, the finest cut: it states how far the two are apart.
//
// Of coarser cuts the certificate says nothing: their errors are estimates so far.

#include "audit/model_check.h"
#include "multires/adaptive_model.h"

namespace pietra {

/// As checkModel(). Throws MemoryError where the model as a whole does not fit the budget.
ModelCheckReport checkAdaptive(const ModelReader& reader, AdaptiveModel& model,
                               const ModelCheckSettings& settings, Budget& budget,
                               Progress& progress);

}  // namespace pietra
