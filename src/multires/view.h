#pragma once
// A view of a model: camera, picture size, and the conservative pixel tolerance (DESIGN: "What a
// pixel tolerance means").

#include <array>

#include "geometry/bounds.h"
#include "geometry/lattice.h"
#include "multires/node.h"

namespace pietra {

/// Right-handed perspective camera in the input's own coordinates.
struct Camera {
    Vec3d eye{0, 0, 0};
    Vec3d target{0, 0, -1};
    Vec3d up{0, 1, 0};
    double fovy_deg = 45;
    bool operator==(const Camera&) const = default;
};

struct PictureSize {
    int width = 1280;
    int height = 1024;
    bool operator==(const PictureSize&) const = default;
};

/// What a tolerance bounds: the error, or, as Wu and Huang (2014, section 6) have it, how large a
/// face shows, whatever its error.
enum class SelectBy { kError, kFaceSize };

/// The camera in lattice coordinates, ready for tests and for drawing.
class View {
public:
    View(const Camera& camera, const PictureSize& size, const Lattice& lattice,
         SelectBy select = SelectBy::kError);

    const PictureSize& size() const { return size_; }
    const Vec3d& eye() const { return eye_; }  ///< lattice coordinates, real
    /// Orthonormal axes: right, up, back (towards the viewer).
    const Vec3d& right() const { return right_; }
    const Vec3d& up() const { return up_; }
    const Vec3d& back() const { return back_; }
    /// Pixels per unit of x/z: image x = width/2 + focal * dot(right, p-eye) / depth.
    double focal_px() const { return focal_; }

    /// No point within `error` of a point of the sphere moves in the image by more than this many
    /// pixels; infinite if the eye is inside the sphere.
    double errorInPixels(float error, const Sphere& saturated) const;
    /// Of a node, what the tolerance bounds, in pixels. Of a face of mean area the side of a square
    /// that is as large as it can show, wherever it is in the sphere and however it is turned.
    double pixelsOf(const Node& node) const {
        return errorInPixels(by_face_size_ ? node.face_size : node.error, node.saturated);
    }
    /// The same view, where what matters is where the surface lies.
    View byError() const {
        View view = *this;
        view.by_face_size_ = false;
        return view;
    }
    /// The sphere lies wholly outside the picture.
    bool outside(const Sphere& bounds) const;
    /// Every triangle with a normal in `cone` within `bounds` faces away from the eye.
    bool facesAway(const NormalCone& cone, const Sphere& bounds) const;

private:
    PictureSize size_;
    Vec3d eye_, right_, up_, back_;
    double focal_;
    bool by_face_size_;
    double error_scale_;         // focal / cos^2 of the picture's corner
    std::array<Vec3d, 4> side_;  // inward unit normals of the frustum's sides, through the eye
};

}  // namespace pietra
