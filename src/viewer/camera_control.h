#pragma once
// The camera in the user's hand: turntable or trackball around a pivot, panning and zooming that
// keep the point under the cursor there, and flying. No window, no clock: pure arithmetic.
//
// Cursor positions are in pixels from the picture's upper left corner. Lengths are the input's.

#include "multires/standard_views.h"

namespace pietra {

class CameraControl {
public:
    enum class Style { kTurntable, kTrackball };

    /// `bounds` of the scene, not empty.
    CameraControl(const Box3d& bounds, UpAxis up, const Camera& start);

    const Camera& camera() const { return camera_; }
    void setBounds(const Box3d& bounds) { bounds_ = bounds; }
    Style style() const { return style_; }
    void setStyle(Style style) { style_ = style; }

    /// Turns around the pivot by a drag of so many pixels; a drag across the picture's height is
    /// half a turn. A turntable keeps the up axis upright and stops short of its poles.
    void rotate(double dx, double dy, const PictureSize& size);
    /// Moves the scene with the cursor at the pivot's depth.
    void pan(double dx, double dy, const PictureSize& size);
    /// Goes by a factor nearer to (below 1) or further from `point`, which stays where it is in the
    /// picture. The least distance is a millionth of the scene.
    void zoom(double factor, const Vec3d& point);
    /// Flies: `right`, `up`, `forward` in units of the speed times the time passed, and turns the
    /// head.
    void fly(double right, double up, double forward);
    void look(double dx, double dy, const PictureSize& size);
    void setPivot(const Vec3d& pivot);
    const Vec3d& pivot() const { return camera_.target; }
    /// The whole scene, from where the camera is.
    void frame(const PictureSize& size);

    /// The point under the cursor at `depth`, the distance along the view axis.
    Vec3d pointUnder(double x, double y, double depth, const PictureSize& size) const;
    /// Depth of the pivot.
    double pivotDepth() const { return glm::length(camera_.target - camera_.eye); }
    /// What a second of flying covers: a third of the way to the pivot.
    double speed() const { return pivotDepth() / 3; }

private:
    struct Axes {
        Vec3d right, up, forward;
    };
    Axes axes() const;
    void turn(const Vec3d& about, double yaw, double pitch, bool move_eye);

    Box3d bounds_;
    Vec3d up_;
    Camera camera_;
    Style style_ = Style::kTurntable;
};

}  // namespace pietra
