#pragma once
// The flights that every model has, computed from a coarse cut of it: so that measurements can be
// repeated by anyone on any model.
//
// Up is the axis told; of a surface that faces one way on the whole, such as a terrain, also where
// it is a piece of a globe, it is that way.

#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "multires/live_model.h"
#include "multires/standard_views.h"
#include "runtime/camera_path.h"
#include "store/model_reader.h"

namespace pietra {

enum class StandardPath {
    kOrbit,       ///< around the whole, from above and below
    kDive,        ///< from the whole to a thousandth of it above its surface
    kFlight,      ///< low over it, along its longer side
    kJumps,       ///< random views from all around and near, each for a second
    kInspection,  ///< turns, and rapid changes from the whole to extreme close-ups: ATP's setting
};

/// "orbit", "dive", "flight", "jumps", "inspection"; empty on anything else.
std::optional<StandardPath> parseStandardPath(std::string_view name);

/// Points of models, in input coordinates.
struct Surface {
    struct Point {
        Vec3d position, normal;  ///< normal of unit length
        double error = 0;        ///< how far the true surface may be
    };
    std::vector<Point> points;
};

/// The vertices of a cut of some ten thousand triangles. Reads a few pages; throws what that
/// throws. `open`: as of a scene (scene.h).
Surface coarseSurface(std::span<const ModelReader* const> models, OpenLive open);

/// 20 seconds; an inspection 45. `surface` must have points. A function of what is given.
CameraPath standardPath(StandardPath path, const Surface& surface, UpAxis up,
                        const PictureSize& size);

}  // namespace pietra
