#pragma once
// Adapted meshes without a clock: reads what they ask for until nothing is missing. For offline
// pictures and coarse looks; the frame path has its loader. Throws MemoryError where the base mesh
// does not fit, and InputError for pages that cannot be read.

#include <functional>
#include <vector>

#include "multires/cut.h"
#include "multires/draw_list.h"
#include "multires/live_model.h"
#include "store/model_reader.h"

namespace pietra {

/// Throws InputError where a model that is no patches cannot be opened so.
std::unique_ptr<LiveModel> openLive(const ModelReader& reader, OpenLive open);

/// Raises the tolerance as long as memory is too small; returns what it is then. Throws MemoryError
/// if the coarsest level does not fit. Reads on all threads.
double settle(const ModelReader& reader, LiveModel& model, const View& view, double pixels,
              size_t most_bytes);

/// The full mesh in parts: refines what lies in one column of the model after the other, as many as
/// memory asks for, and shows it to visit(column), which draws the triangles that the column holds.
/// Each triangle of the input is in one of them. Throws MemoryError if not even columns of a few
/// triangles fit, Interrupted, and what reading throws.
void visitColumns(const ModelReader& reader, LiveModel& model, const View& view, size_t most_bytes,
                  const std::function<void(const LiveColumn&)>& visit);

/// Of what is drawn now. Within the box of all closed chunks the eye counts as inside.
bool eyeMayBeInside(const LiveModel& model, const View& view);

/// What is to be drawn of it; valid as long as the chunks are. `number`: the model's in the scene.
/// `two_sided`: the eye may be inside of a closed part. value: the error in pixels, or the level.
void listChunks(const LiveModel& model, uint32_t number, const View& view, const Culling& culling,
                bool two_sided, bool show_error, std::vector<DrawPatch>& list);

/// Refines the same everywhere, until there are more than about so many triangles or no more
/// are known. May read some pages.
void refineEvenly(const ModelReader& reader, LiveModel& model, uint64_t triangles);

}  // namespace pietra
