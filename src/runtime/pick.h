#pragma once
// Points of the input's own surface under the cursor, however coarse the picture is.

#include <optional>
#include <span>

#include "multires/view.h"
#include "store/model_reader.h"

namespace pietra {

/// Where the ray from `eye` first meets the finest level of any of the models; nothing where it
/// meets none; models whose pages are not patches are left out. Input coordinates; exact but for
/// rounding. Reads and decodes the pages along the ray, nearest first, one in memory at a time: not
/// for the frame thread. Thread-safe. Throws what ModelReader::decode throws.
std::optional<Vec3d> pickFinest(std::span<const ModelReader* const> models, const Vec3d& eye,
                                const Vec3d& direction);

}  // namespace pietra
