#pragma once
// Where faces cannot be merged, as they hang together with nothing (dust): whole components leave.

#include "methods/cluster/layer_step.h"

namespace pietra::cluster {

/// Leaves out the smallest components that no other cell has a part of, until about `most`
/// triangles are left, or one component.
void dropComponents(LayerStep& step, size_t most);

}  // namespace pietra::cluster
