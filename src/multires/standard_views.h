#pragma once
// The cameras that `--view NAME` means: from the front, the back, the left, the right, the top, the
// bottom, or a corner (iso), so that a whole box is in the picture. Pure functions.

#include <optional>
#include <span>
#include <string_view>

#include "multires/view.h"

namespace pietra {

enum class StandardView { kFront, kBack, kLeft, kRight, kTop, kBottom, kIso };
enum class UpAxis { kY, kZ };
inline Vec3d upVector(UpAxis axis) {
    return axis == UpAxis::kY ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
}

/// "front", "back", "left", "right", "top", "bottom", "iso"; empty on anything else.
std::optional<StandardView> parseStandardView(std::string_view name);

/// With z up, `front` looks along +y, `left` stands on the side of -x and looks along +x, `top`
/// looks along -z with +y upwards in the picture, `iso` looks from the right, the front and above.
/// With y up all this is turned about x by a quarter: `front` looks along -z, as in glTF.
///
/// The camera looks at the centre of `box`, from the least distance at which all of it lies inside
/// the picture, with a margin of 1/20 of the picture's half sides. `box` in input coordinates, not
/// empty; one that is a single point is looked at from a distance of 1.
Camera standardCamera(StandardView view, UpAxis up_axis, const Box3d& box, const PictureSize& size,
                      double fovy_deg = 45);

/// The same camera, moved along its axis to the least distance from its target at which all `balls`
/// (input coordinates) lie inside the picture with the same margin, if that is nearer: a model need
/// not reach into the corners of its box.
Camera movedCloser(const Camera& camera, std::span<const Sphere> balls, const PictureSize& size);

}  // namespace pietra
