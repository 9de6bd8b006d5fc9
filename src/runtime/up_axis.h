#pragma once
// Which way up a model stands, where nobody says: a guess.

#include "multires/standard_views.h"
#include "runtime/standard_paths.h"

namespace pietra {

/// What is flat like a relief lies; else y is up if the model stands more firmly on it: its lowest
/// slice is wide, its normals there point down, or a missing base leaves more of them pointing up.
/// z where nothing tells.
UpAxis guessUpAxis(const Surface& surface);

}  // namespace pietra
