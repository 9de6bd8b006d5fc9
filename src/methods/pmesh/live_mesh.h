#pragma once
// A progressive mesh as it is looked at (multires/live_model.h): the nodes that are in memory, the
// active mesh, and the chunks that are drawn of it.
//
// Memory: kNodeBytes a node that is loaded, kVertexBytes a vertex of the active mesh. Together they
// do not exceed what a frame allows; where a vertex has no room, it waits, and the mesh is coarser
// there. What nodes and vertices that have left took goes back to the system, once it is a quarter
// of all or memory is short.

#include <memory>

#include "methods/pmesh/active_mesh.h"
#include "multires/live_model.h"
#include "store/model_reader.h"

namespace pietra::pmesh {

/// Of a vertex: chunks, about; arrays, sets and lists that look for work; sorting, which copies the
/// largest array while it lasts.
inline constexpr size_t kChunkBytes = 72;
inline constexpr size_t kActiveBytes = sizeof(Vertex) + sizeof(VertexPulse) +
                                       sizeof(VertexCriteria) + sizeof(VertexRecord) +
                                       2 * sizeof(ActiveFace) + 8;
inline constexpr size_t kSortingBytes = 2 * sizeof(ActiveFace) + 12;
inline constexpr size_t kVertexBytes = kChunkBytes + kActiveBytes + kSortingBytes;

/// Reads the base mesh and the roots; throws InputError where these are damaged.
std::unique_ptr<LiveModel> openLive(const ModelReader& reader);

}  // namespace pietra::pmesh
