#pragma once
// A progressive mesh as it is looked at (multires/live_model.h): the nodes that are in memory, the
// active mesh, and the chunks that are drawn of it.
//
// Memory: kNodeBytes a node that is loaded, kVertexBytes a vertex of the active mesh. Neither
// exceeds what a frame allows; where a vertex has no room, it waits, and the mesh is coarser there.

#include <memory>

#include "multires/live_model.h"
#include "store/model_reader.h"

namespace pietra::pmesh {

/// Of the active mesh with its chunks, growing.
inline constexpr size_t kVertexBytes = 240;

/// Reads the base mesh and the roots; throws InputError where these are damaged.
std::unique_ptr<LiveModel> openLive(const ModelReader& reader);

}  // namespace pietra::pmesh
