#include "runtime/standard_paths.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "base/hash.h"

namespace pietra {
namespace {

constexpr double kSeconds = 20;
constexpr int kSteps = 80;  // keys of a smooth path: four a second
constexpr double kTurn = 6.283185307179586;

/// The model's box with an up axis, and what lies where in it.
class Ground {
public:
    Ground(std::span<const Vec3d> surface, UpAxis up) : surface_(surface), up_axis_(up) {
        for (const Vec3d& p : surface) box_.add(p);
        up_ = up == UpAxis::kY ? Vec3d(0, 1, 0) : Vec3d(0, 0, 1);
        const Vec3d extent = box_.max - box_.min;
        along_ = Vec3d(1, 0, 0);
        const Vec3d other = up == UpAxis::kY ? Vec3d(0, 0, 1) : Vec3d(0, 1, 0);
        if (glm::dot(other, extent) > extent.x) along_ = other;
    }

    const Box3d& box() const { return box_; }
    Vec3d centre() const { return 0.5 * (box_.min + box_.max); }
    double size() const { return glm::length(box_.max - box_.min); }
    const Vec3d& up() const { return up_; }
    const Vec3d& along() const { return along_; }
    UpAxis upAxis() const { return up_axis_; }

    /// The highest point within `radius` of the vertical line through p; p where there is none.
    Vec3d highest(const Vec3d& p, double radius) const {
        Vec3d best = p;
        double height = -HUGE_VAL;
        for (const Vec3d& q : surface_) {
            const Vec3d off = (q - p) - up_ * glm::dot(q - p, up_);
            if (glm::dot(off, off) > radius * radius || glm::dot(q, up_) <= height) continue;
            best = q;
            height = glm::dot(q, up_);
        }
        return best;
    }

private:
    std::span<const Vec3d> surface_;
    UpAxis up_axis_;
    Box3d box_;
    Vec3d up_, along_;
};

Camera lookFrom(const Vec3d& eye, const Vec3d& target, const Ground& ground) {
    Camera camera;
    camera.eye = eye;
    camera.target = target;
    camera.up = ground.up();
    return camera;
}

CameraPath orbit(const Ground& ground, const PictureSize& size) {
    const Camera whole = standardCamera(StandardView::kFront, ground.upAxis(), ground.box(), size);
    const double distance = glm::length(whole.eye - whole.target);
    const Vec3d side = glm::cross(ground.along(), ground.up());
    CameraPath path{kSeconds, {}};
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps, angle = kTurn * t, lift = 0.7 * std::sin(2 * angle);
        const Vec3d direction =
            std::cos(lift) * (std::cos(angle) * ground.along() + std::sin(angle) * side) +
            std::sin(lift) * ground.up();
        path.keys.push_back({kSeconds * t, lookFrom(ground.centre() + distance * direction,
                                                    ground.centre(), ground)});
    }
    return path;
}

CameraPath dive(const Ground& ground, const PictureSize& size) {
    const Camera whole = standardCamera(StandardView::kIso, ground.upAxis(), ground.box(), size);
    const Vec3d goal = ground.highest(ground.centre(), 0.1 * ground.size());
    const Vec3d direction = glm::normalize(whole.eye - whole.target);
    const double from = glm::length(whole.eye - goal), to = 1e-3 * ground.size();
    CameraPath path{kSeconds, {}};
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps;
        const double distance = from * std::pow(to / from, t);
        const Vec3d target = whole.target + (goal - whole.target) * std::min(1.0, 4 * t);
        path.keys.push_back(
            {kSeconds * t, lookFrom(target + distance * direction, target, ground)});
    }
    return path;
}

CameraPath flight(const Ground& ground) {
    const double size = ground.size(), clearance = 0.02 * size;
    const double half = 0.5 * glm::dot(ground.box().max - ground.box().min, ground.along());
    CameraPath path{kSeconds, {}};
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps;
        const Vec3d below = ground.centre() + ground.along() * (half * (2 * t - 1));
        // Smooth: the highest around, a little of it each.
        double height = 0;
        constexpr int kAround = 8;
        for (int k = -kAround; k <= kAround; ++k) {
            const Vec3d p = below + ground.along() * (0.01 * size * k);
            height += glm::dot(ground.highest(p, 0.05 * size), ground.up()) / (2 * kAround + 1);
        }
        const Vec3d eye = below + ground.up() * (height + clearance - glm::dot(below, ground.up()));
        const Vec3d target = eye + ground.along() * (0.2 * size) - ground.up() * (0.06 * size);
        path.keys.push_back({kSeconds * t, lookFrom(eye, target, ground)});
    }
    return path;
}

CameraPath jumps(const Ground& ground, std::span<const Vec3d> surface) {
    CameraPath path{kSeconds, {}};
    uint64_t state = 1;
    const auto real = [&] {
        return double(mixBits(state += 0x9e3779b97f4a7c15ULL) >> 11) * 0x1p-53;
    };
    for (int i = 0; i < int(kSeconds); ++i) {
        const Vec3d target = surface[size_t(real() * double(surface.size()))];
        const Vec3d from_centre = target - ground.centre();
        Vec3d direction(real() - 0.5, real() - 0.5, real() - 0.5);
        if (glm::dot(direction, from_centre) < 0) direction = -direction;  // rather from outside
        direction += ground.up() * 0.3;
        const double distance = ground.size() * std::pow(10, -2.5 * real());
        const Camera camera =
            lookFrom(target + distance * glm::normalize(direction), target, ground);
        path.keys.push_back({double(i), camera});
        path.keys.push_back({i + 0.999, camera});
    }
    return path;
}

}  // namespace

std::optional<StandardPath> parseStandardPath(std::string_view name) {
    if (name == "orbit") return StandardPath::kOrbit;
    if (name == "dive") return StandardPath::kDive;
    if (name == "flight") return StandardPath::kFlight;
    if (name == "jumps") return StandardPath::kJumps;
    return {};
}

CameraPath standardPath(StandardPath path, std::span<const Vec3d> surface, UpAxis up,
                        const PictureSize& size) {
    CHECK(!surface.empty());
    const Ground ground(surface, up);
    switch (path) {
        case StandardPath::kOrbit:
            return orbit(ground, size);
        case StandardPath::kDive:
            return dive(ground, size);
        case StandardPath::kFlight:
            return flight(ground);
        case StandardPath::kJumps:
            break;
    }
    return jumps(ground, surface);
}

}  // namespace pietra
