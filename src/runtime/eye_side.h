#pragma once
// On which side of a model's closed parts is the eye? From outside, what faces away is hidden and
// may be culled; from within, it is all there is to see.

#include "multires/view.h"
#include "store/model_reader.h"

namespace pietra {

/// True unless the eye is certainly outside of all closed parts: by the winding number (van
/// Oosterom, Strackee 1983) of a cut that is coarse but near the eye, and no nearer to it than its
/// error. Reads some pages; throws what that throws. Linear in the cut's triangles.
bool eyeMayBeInside(const ModelReader& model, const View& view);

}  // namespace pietra
