#include "multires/view.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace pietra {

View::View(const Camera& camera, const PictureSize& size, const Lattice& lattice, SelectBy select)
    : size_(size),
      eye_(lattice.toLattice(camera.eye)),
      by_face_size_(select == SelectBy::kFaceSize) {
    back_ = glm::normalize(camera.eye - camera.target);
    Vec3d right = glm::cross(camera.up, back_);
    if (!(glm::dot(right, right) > 1e-24)) {  // looking along `up`: any other axis will do
        const Vec3d other = std::abs(back_.x) < 0.9 ? Vec3d(1, 0, 0) : Vec3d(0, 1, 0);
        right = glm::cross(other, back_);
    }
    right_ = glm::normalize(right);
    up_ = glm::cross(back_, right_);
    const double tan_y = std::tan(camera.fovy_deg * std::numbers::pi / 360);
    const double tan_x = tan_y * size.width / size.height;
    focal_ = size.height / (2 * tan_y);
    error_scale_ = focal_ * (1 + tan_x * tan_x + tan_y * tan_y);
    const Vec3d forward = -back_;
    side_ = {glm::normalize(right_ + tan_x * forward), glm::normalize(-right_ + tan_x * forward),
             glm::normalize(up_ + tan_y * forward), glm::normalize(-up_ + tan_y * forward)};
}

double View::errorInPixels(float error, const Sphere& saturated) const {
    const double distance = glm::length(Vec3d(saturated.centre) - eye_) - saturated.radius;
    return distance > 0 ? error * error_scale_ / distance : std::numeric_limits<double>::infinity();
}

bool View::outside(const Sphere& bounds) const {
    const Vec3d centre = Vec3d(bounds.centre) - eye_;
    if (glm::dot(centre, back_) > bounds.radius) return true;
    for (const Vec3d& side : side_)
        if (glm::dot(side, centre) < -double(bounds.radius)) return true;
    return false;
}

bool View::facesAway(const NormalCone& cone, const Sphere& bounds) const {
    if (cone.cos_angle <= 0) return false;
    // Away means dot(n, p - eye) > 0 for every n of the cone and every p of the sphere: the angle
    // between the axis and the direction to the centre, plus both half-angles, stays below 90
    // degrees.
    const Vec3d to_centre = Vec3d(bounds.centre) - eye_;
    const double distance = glm::length(to_centre);
    if (distance <= bounds.radius) return false;
    const double sin_cone = std::sqrt(std::max(0.0, 1.0 - double(cone.cos_angle) * cone.cos_angle));
    const double sin_sphere = bounds.radius / distance;
    const double cos_sphere = std::sqrt(1 - sin_sphere * sin_sphere);
    // sin(cone + sphere) and cos(cone + sphere); the sum must stay below 90 degrees.
    const double sin_sum = sin_cone * cos_sphere + cone.cos_angle * sin_sphere;
    const double cos_sum = cone.cos_angle * cos_sphere - sin_cone * sin_sphere;
    return cos_sum > 0 && glm::dot(Vec3d(cone.axis), to_centre) / distance > sin_sum + 1e-6;
}

}  // namespace pietra
