#include "viewer/camera_control.h"

#include <algorithm>
#include <cmath>

namespace pietra {
namespace {

constexpr double kHalfTurn = 3.14159265358979323846;
/// A turntable comes as near as this to its poles.
constexpr double kPole = 0.02;

Vec3d rotated(const Vec3d& v, const Vec3d& axis, double angle) {
    const double c = std::cos(angle), s = std::sin(angle);
    return v * c + glm::cross(axis, v) * s + axis * (glm::dot(axis, v) * (1 - c));
}

double pixelsPerUnit(const Camera& camera, const PictureSize& size) {
    return 0.5 * size.height / std::tan(camera.fovy_deg * kHalfTurn / 360);
}

}  // namespace

CameraControl::CameraControl(const Box3d& bounds, UpAxis up, const Camera& start)
    : bounds_(bounds), up_(upVector(up)), camera_(start) {}

CameraControl::Axes CameraControl::axes() const {
    const Vec3d forward = glm::normalize(camera_.target - camera_.eye);
    const Vec3d right = glm::normalize(glm::cross(forward, camera_.up));
    return {right, glm::cross(right, forward), forward};
}

/// Turns the line of sight; about the target the eye moves, about the eye the target.
void CameraControl::turn(const Vec3d& about, double yaw, double pitch, bool move_eye) {
    const Axes a = axes();
    Vec3d sight = camera_.target - camera_.eye;
    if (style_ == Style::kTurntable) {
        const double angle = std::acos(std::clamp(glm::dot(a.forward, up_), -1.0, 1.0));
        pitch = std::clamp(pitch, angle - (kHalfTurn - kPole), angle - kPole);
        sight = rotated(rotated(sight, a.right, pitch), up_, yaw);
        camera_.up = up_;
    } else {
        sight = rotated(rotated(sight, a.right, pitch), a.up, yaw);
        camera_.up = rotated(a.up, a.right, pitch);
    }
    if (move_eye)
        camera_.eye = about - sight;
    else
        camera_.target = about + sight;
}

void CameraControl::rotate(double dx, double dy, const PictureSize& size) {
    const double scale = kHalfTurn / size.height;
    turn(camera_.target, -dx * scale, -dy * scale, true);
}

void CameraControl::look(double dx, double dy, const PictureSize& size) {
    const double scale = 1 / pixelsPerUnit(camera_, size);
    turn(camera_.eye, -dx * scale, -dy * scale, false);
}

void CameraControl::pan(double dx, double dy, const PictureSize& size) {
    const Axes a = axes();
    const double scale = pivotDepth() / pixelsPerUnit(camera_, size);
    const Vec3d move = a.up * (dy * scale) - a.right * (dx * scale);
    camera_.eye += move;
    camera_.target += move;
}

void CameraControl::zoom(double factor, const Vec3d& point) {
    const double least = 1e-6 * glm::length(bounds_.max - bounds_.min);
    const Vec3d eye = point + (camera_.eye - point) * factor;
    const Vec3d target = point + (camera_.target - point) * factor;
    if (glm::length(eye - point) < least || glm::length(target - eye) < least) return;
    camera_.eye = eye;
    camera_.target = target;
}

void CameraControl::fly(double right, double up, double forward) {
    const Axes a = axes();
    const Vec3d move = (a.right * right + a.up * up + a.forward * forward) * speed();
    camera_.eye += move;
    camera_.target += move;
}

void CameraControl::setPivot(const Vec3d& pivot) {
    if (glm::length(pivot - camera_.eye) > 0) camera_.target = pivot;
}

void CameraControl::frame(const PictureSize& size) {
    const Vec3d back = -axes().forward;
    const double radius = 0.5 * glm::length(bounds_.max - bounds_.min);
    const double half =
        std::atan(0.5 * std::min(size.width, size.height) / pixelsPerUnit(camera_, size));
    camera_.target = 0.5 * (bounds_.min + bounds_.max);
    camera_.eye = camera_.target + back * (std::max(radius, 1e-300) / std::sin(half));
}

Vec3d CameraControl::pointUnder(double x, double y, double depth, const PictureSize& size) const {
    const Axes a = axes();
    const double focal = pixelsPerUnit(camera_, size);
    return camera_.eye + (a.forward + a.right * ((x - 0.5 * size.width) / focal) -
                          a.up * ((y - 0.5 * size.height) / focal)) *
                             depth;
}

}  // namespace pietra
