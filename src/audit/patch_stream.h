#pragma once
// How the audit sees a model: a table of nodes, and something that hands out patches. The audit
// thus knows neither the file nor a method.

#include <functional>
#include <span>

#include "geometry/mesh.h"
#include "multires/node.h"

namespace pietra {

/// Called once for each patch; thread-safe wherever the audit passes one on.
using PatchVisitor = std::function<void(NodeIndex, const Mesh&)>;

/// Visits the patches of the nodes given, each once, in any order, by any number of threads at
/// once. May be called any number of times. Throws what reading and decoding throw.
using PatchStream = std::function<void(std::span<const NodeIndex>, const PatchVisitor&)>;

}  // namespace pietra
