#include "multires/standard_views.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "base/check.h"

namespace pietra {

namespace {

constexpr double kMargin = 0.05;

struct Direction {
    Vec3d forward;
    Vec3d up;
};

/// With z up.
Direction directionOf(StandardView view) {
    switch (view) {
        case StandardView::kFront:
            return {{0, 1, 0}, {0, 0, 1}};
        case StandardView::kBack:
            return {{0, -1, 0}, {0, 0, 1}};
        case StandardView::kLeft:
            return {{1, 0, 0}, {0, 0, 1}};
        case StandardView::kRight:
            return {{-1, 0, 0}, {0, 0, 1}};
        case StandardView::kTop:
            return {{0, 0, -1}, {0, 1, 0}};
        case StandardView::kBottom:
            return {{0, 0, 1}, {0, -1, 0}};
        case StandardView::kIso:
            break;
    }
    return {glm::normalize(Vec3d(-1, 1, -1)), {0, 0, 1}};
}

/// Least distance of the eye from the centre at which all corners of the box project inside.
double fittingDistance(const Direction& direction, const Vec3d& half, double tan_x, double tan_y) {
    const Vec3d right = glm::normalize(glm::cross(direction.forward, direction.up));
    const Vec3d up = glm::cross(right, direction.forward);
    double distance = 0;
    for (int corner = 0; corner < 8; ++corner) {
        const Vec3d offset(corner & 1 ? half.x : -half.x, corner & 2 ? half.y : -half.y,
                           corner & 4 ? half.z : -half.z);
        const double beside = std::max(std::abs(glm::dot(offset, right)) / tan_x,
                                       std::abs(glm::dot(offset, up)) / tan_y);
        const double before = -glm::dot(offset, direction.forward);
        // note: seen end on, a box without width would have its nearest corner in the eye itself.
        distance = std::max({distance, before + beside, 1.05 * before});
    }
    return distance;
}

}  // namespace

std::optional<StandardView> parseStandardView(std::string_view name) {
    constexpr std::pair<const char*, StandardView> views[] = {
        {"front", StandardView::kFront}, {"back", StandardView::kBack},
        {"left", StandardView::kLeft},   {"right", StandardView::kRight},
        {"top", StandardView::kTop},     {"bottom", StandardView::kBottom},
        {"iso", StandardView::kIso}};
    for (const auto& [known, view] : views)
        if (name == known) return view;
    return std::nullopt;
}

Camera standardCamera(StandardView view, UpAxis up_axis, const Box3d& box, const PictureSize& size,
                      double fovy_deg) {
    CHECK(!box.empty());
    Direction direction = directionOf(view);
    if (up_axis == UpAxis::kY)
        for (Vec3d* v : {&direction.forward, &direction.up}) *v = {v->x, v->z, -v->y};
    const double tan_y = std::tan(fovy_deg * std::numbers::pi / 360) * (1 - kMargin);
    const double tan_x = tan_y * size.width / size.height;
    const Vec3d half = (box.max - box.min) * 0.5;
    const Vec3d centre = box.min + half;
    double distance = fittingDistance(direction, half, tan_x, tan_y);
    if (distance == 0) distance = 1;
    return {centre - distance * direction.forward, centre, direction.up, fovy_deg};
}

Camera movedCloser(const Camera& camera, std::span<const Sphere> balls, const PictureSize& size) {
    const double tan_y = std::tan(camera.fovy_deg * std::numbers::pi / 360) * (1 - kMargin);
    const double tan_x = tan_y * size.width / size.height;
    const double now = glm::length(camera.target - camera.eye);
    const Vec3d forward = (camera.target - camera.eye) / now;
    const Vec3d right = glm::normalize(glm::cross(forward, camera.up));
    const Vec3d up = glm::cross(right, forward);
    double distance = 0;
    for (const Sphere& ball : balls) {
        const Vec3d offset = Vec3d(ball.centre) - camera.target;
        // A side plane of slope t is a ball's radius away where depth is r sqrt(1 + t^2) / t more.
        const double x = (std::abs(glm::dot(offset, right)) +
                          ball.radius * std::sqrt(1 + tan_x * tan_x)) / tan_x;
        const double y = (std::abs(glm::dot(offset, up)) +
                          ball.radius * std::sqrt(1 + tan_y * tan_y)) / tan_y;
        const double before = -glm::dot(offset, forward);
        distance = std::max({distance, before + std::max(x, y), 1.05 * (before + ball.radius)});
    }
    Camera closer = camera;
    if (distance > 0 && distance < now) closer.eye = camera.target - distance * forward;
    return closer;
}

}  // namespace pietra
