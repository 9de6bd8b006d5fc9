#pragma once
// A progressive mesh as it is looked at (multires/live_model.h): the nodes that are in memory, the
// active vertices, and the chunks that are drawn of them.
//
// Memory: ResidentSplits::nodeBytes() a node that is loaded, SplitFront::kVertexBytes and a chunk's
// part a vertex, and 1.5 bits a leaf. Together they do not exceed what a frame allows; where there
// is no room, the mesh is what a coarser tolerance asks for. What nodes and vertices that have left
// took goes back to the system, once it is a quarter of all or memory is short.

#include <memory>

#include "methods/pmesh/split_node.h"
#include "multires/live_model.h"

namespace pietra::pmesh {

/// Of `forest`, with its roots' nodes at least.
std::unique_ptr<LiveModel> liveOf(SplitForest forest, const ModelInfo& info);

/// Reads the base mesh and the roots; throws InputError where these are damaged.
std::unique_ptr<LiveModel> openLive(const ModelReader& reader);

}  // namespace pietra::pmesh
