#pragma once
// The flights that every model has, computed from its coarsest cut: so that measurements can be
// repeated by anyone on any model.

#include <optional>
#include <span>
#include <string_view>

#include "multires/standard_views.h"
#include "runtime/camera_path.h"

namespace pietra {

enum class StandardPath {
    kOrbit,   ///< around the whole, from above and below
    kDive,    ///< from the whole to a thousandth of it above its surface
    kFlight,  ///< low over it, along its longer side
    kJumps,   ///< random views from all around and near, each for a second
};

/// "orbit", "dive", "flight", "jumps"; empty on anything else.
std::optional<StandardPath> parseStandardPath(std::string_view name);

/// 20 seconds. `surface`: points of the model, some hundreds to thousands, in input coordinates,
/// not empty. A function of the points, the axis and the size.
CameraPath standardPath(StandardPath path, std::span<const Vec3d> surface, UpAxis up,
                        const PictureSize& size);

}  // namespace pietra
