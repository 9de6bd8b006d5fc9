#include "runtime/standard_paths.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>
#include <tuple>

#include "base/check.h"
#include "base/hash.h"
#include "multires/cut.h"
#include "runtime/live_settle.h"
#include "runtime/patch_reader.h"

namespace pietra {
namespace {

constexpr double kSeconds = 20;
constexpr int kSteps = 80;  // keys of a smooth path: four a second
constexpr double kTurn = 6.283185307179586;
constexpr double kSurfaceTriangles = 60000;
/// Mean normals longer than this are those of a surface that faces one way.
constexpr double kFacesOneWay = 0.5;
/// The nearest that a path comes to the surface, of the model's size.
constexpr double kNear = 1e-3;

/// The model as a path sees it: a frame of axes, and what lies where.
class Ground {
public:
    Ground(const Surface& surface, UpAxis up, const PictureSize& size) : surface_(surface) {
        Vec3d facing(0, 0, 0);
        for (const Surface::Point& p : surface.points) facing += p.normal;
        facing /= double(surface.points.size());
        up_ = upVector(up);
        if (glm::length(facing) > kFacesOneWay) up_ = glm::normalize(facing);
        along_ = Vec3d(1, 0, 0) - up_ * up_.x;
        if (glm::length(along_) < 0.5) along_ = Vec3d(0, 1, 0) - up_ * up_.y;
        along_ = glm::normalize(along_);
        if (extent(side()).second > extent(along_).second) along_ = side();
        for (const Vec3d& axis : {up_, along_, side()}) centre_ += axis * extent(axis).first;
        for (const Surface::Point& p : surface.points)
            radius_ = std::max(radius_, glm::length(p.position - centre_));
        // A ball that fits into the picture.
        const double fit = std::min(1.0, double(size.width) / size.height);
        whole_ = 1.02 * radius_ / (fit * std::sin(kTurn / 16));
    }

    const Vec3d& centre() const { return centre_; }
    double size() const { return 2 * radius_; }
    double wholeDistance() const { return whole_; }
    double nearest(const Surface::Point& p) const { return kNear * size() + p.error; }
    const Vec3d& up() const { return up_; }
    const Vec3d& along() const { return along_; }
    Vec3d side() const { return glm::cross(along_, up_); }
    double halfLength() const { return extent(along_).second; }
    std::span<const Surface::Point> points() const { return surface_.points; }

    Vec3d direction(double azimuth, double elevation) const {
        return std::cos(elevation) * (std::cos(azimuth) * along_ + std::sin(azimuth) * side()) +
               std::sin(elevation) * up_;
    }

    /// Height over the centre of the highest point within `radius` of the vertical line through p;
    /// that of the lowest of all where there is none.
    double top(const Vec3d& p, double radius) const {
        double height = -extent(up_).second;
        for (const Surface::Point& q : surface_.points) {
            const Vec3d off = q.position - p;
            const double up = glm::dot(off, up_);
            if (glm::dot(off, off) - up * up <= radius * radius)
                height = std::max(height, glm::dot(q.position - centre_, up_));
        }
        return height;
    }

    /// What is met first on the way from `direction` to the centre, or beside it.
    const Surface::Point& firstMet(const Vec3d& direction) const {
        const Surface::Point* best = nullptr;
        double most = -HUGE_VAL;
        for (const Surface::Point& p : surface_.points) {
            const Vec3d off = p.position - centre_;
            const double depth = glm::dot(off, direction);
            const double beside = glm::length(off - depth * direction);
            const double score = depth - 20 * std::max(0.0, beside - 0.02 * size());
            if (score <= most || glm::dot(p.normal, direction) < 0.3) continue;
            most = score;
            best = &p;
        }
        return best ? *best : surface_.points.front();
    }

    /// By the side of the nearest point.
    bool outside(const Vec3d& eye) const {
        const auto nearer = [&](const Surface::Point& a, const Surface::Point& b) {
            return glm::dot(a.position - eye, a.position - eye) <
                   glm::dot(b.position - eye, b.position - eye);
        };
        const Surface::Point& p =
            *std::min_element(surface_.points.begin(), surface_.points.end(), nearer);
        return glm::dot(eye - p.position, p.normal) > 0;
    }

private:
    /// Middle and half length.
    std::pair<double, double> extent(const Vec3d& axis) const {
        double low = HUGE_VAL, high = -HUGE_VAL;
        for (const Surface::Point& p : surface_.points) {
            low = std::min(low, glm::dot(p.position, axis));
            high = std::max(high, glm::dot(p.position, axis));
        }
        return {(low + high) / 2, (high - low) / 2};
    }

    const Surface& surface_;
    Vec3d up_, along_, centre_{0, 0, 0};
    double radius_ = 0, whole_ = 0;
};

Camera lookFrom(const Vec3d& eye, const Vec3d& target, const Ground& ground) {
    Camera camera;
    camera.eye = eye;
    camera.target = target;
    camera.up = ground.up();
    return camera;
}

CameraPath orbit(const Ground& ground) {
    CameraPath path{kSeconds, {}};
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps, angle = kTurn * t;
        const Vec3d off =
            ground.wholeDistance() * ground.direction(angle, 0.4 + 0.7 * std::sin(2 * angle));
        path.keys.push_back(
            {kSeconds * t, lookFrom(ground.centre() + off, ground.centre(), ground)});
    }
    return path;
}

/// A camera by what it looks at.
struct Station {
    double t;
    Vec3d target;
    double distance, azimuth, elevation;
};

/// Between two stations the distance changes by equal factors, and what is looked at moves with it:
/// the eye goes straight.
Station between(const Station& a, const Station& b, double t) {
    double s = (t - a.t) / (b.t - a.t);
    s = s * s * (3 - 2 * s);
    const double distance = a.distance * std::pow(b.distance / a.distance, s);
    const double change = b.distance - a.distance;
    const bool zooms = std::abs(change) > 0.5 * std::max(a.distance, b.distance);
    const double moved = zooms ? (distance - a.distance) / change : s;
    return {t, a.target + (b.target - a.target) * moved, distance,
            a.azimuth + (b.azimuth - a.azimuth) * s, a.elevation + (b.elevation - a.elevation) * s};
}

CameraPath through(std::span<const Station> stations, const Ground& ground) {
    CameraPath path{stations.back().t, {}};
    const int steps = int(path.seconds * kSteps / kSeconds);
    size_t leg = 0;
    for (int i = 0; i <= steps; ++i) {
        const double t = path.seconds * i / steps;
        while (leg + 2 < stations.size() && stations[leg + 1].t <= t) ++leg;
        const Station s = between(stations[leg], stations[leg + 1], t);
        const Vec3d off = s.distance * ground.direction(s.azimuth, s.elevation);
        path.keys.push_back({t, lookFrom(s.target + off, s.target, ground)});
    }
    return path;
}

CameraPath dive(const Ground& ground) {
    const double azimuth = 1, elevation = 0.6;
    const Surface::Point& goal = ground.firstMet(ground.direction(azimuth, elevation));
    const Station stations[] = {
        {0, ground.centre(), ground.wholeDistance(), azimuth, elevation},
        {kSeconds, goal.position, ground.nearest(goal), azimuth, elevation}};
    return through(stations, ground);
}

CameraPath inspection(const Ground& ground) {
    const double whole = ground.wholeDistance(), close = 0.01 * ground.size();
    const auto at = [&](double azimuth, double elevation) {
        return ground.firstMet(ground.direction(azimuth, elevation));
    };
    const Surface::Point a = at(1.8, 0.5), b = at(4.2, 0.8), c = at(5.6, 0.6);
    const Station stations[] = {{0, ground.centre(), whole, 0, 0.4},
                                {8, ground.centre(), whole, 1.8, 0.5},
                                {11, a.position, a.error + close, 1.8, 0.5},
                                {16, a.position, a.error + 2 * close, 2.3, 0.6},
                                {18, ground.centre(), whole, 2.3, 0.6},
                                {23, ground.centre(), 0.6 * whole, 4.2, 0.8},
                                {25, b.position, b.error + 0.4 * close, 4.2, 0.8},
                                {30, b.position, b.error + 0.3 * close, 4.5, 0.9},
                                {32, ground.centre(), whole, 4.5, 0.6},
                                {36, ground.centre(), whole, 5.6, 0.6},
                                {39, c.position, ground.nearest(c), 5.6, 0.6},
                                {42, c.position, ground.nearest(c), 5.8, 0.7},
                                {45, ground.centre(), whole, 5.8, 0.7}};
    return through(stations, ground);
}

/// Heights along the line of flight, above all that is near it, and smooth: means of so many tops
/// that each is the top of a stretch around the same place.
class Heights {
public:
    static constexpr double kReach = 0.1, kStep = 0.01;  // of the size
    explicit Heights(const Ground& ground) : step_(kStep * ground.size()) {
        reach_ = int(std::ceil(2 * ground.halfLength() / step_));
        for (int i = -reach_; i <= reach_; ++i)
            top_.push_back(
                ground.top(ground.centre() + ground.along() * (i * step_), kReach * ground.size()));
    }
    double at(double x) const {
        constexpr int kAround = int(kReach / kStep) - 2;
        double sum = 0;
        for (int k = -kAround; k <= kAround; ++k) sum += topAt(x / step_ + k);
        return sum / (2 * kAround + 1);
    }

private:
    double topAt(double i) const {
        const double place = std::clamp(i + reach_, 0.0, double(top_.size() - 1));
        const size_t before = std::min(size_t(place), top_.size() - 2);
        const double s = place - double(before);
        return top_[before] * (1 - s) + top_[before + 1] * s;
    }

    double step_;
    int reach_;
    std::vector<double> top_;
};

CameraPath flight(const Ground& ground) {
    const double ahead = 0.2 * ground.size(), half = ground.halfLength();
    const Heights heights(ground);
    const auto over = [&](double x, double clearance) {
        return ground.centre() + ground.along() * x + ground.up() * (heights.at(x) + clearance);
    };
    CameraPath path{kSeconds, {}};
    for (int i = 0; i <= kSteps; ++i) {
        const double t = double(i) / kSteps, x = half * (1.7 * t - 1.1);
        path.keys.push_back(
            {kSeconds * t, lookFrom(over(x, 0.02 * ground.size()),
                                    over(x + ahead, -0.03 * ground.size()), ground)});
    }
    return path;
}

CameraPath jumps(const Ground& ground) {
    CameraPath path{kSeconds, {}};
    uint64_t state = 1;
    const auto real = [&] {
        return double(mixBits(state += 0x9e3779b97f4a7c15ULL) >> 11) * 0x1p-53;
    };
    constexpr int kTries = 20;
    for (int i = 0; i < int(kSeconds); ++i) {
        Camera camera;
        for (int tries = 0; tries < kTries; ++tries) {
            const Surface::Point& p =
                ground.points()[size_t(real() * double(ground.points().size()))];
            const Vec3d aside(real() - 0.5, real() - 0.5, real() - 0.5);
            const double distance = ground.nearest(p) + ground.size() * std::pow(10, -2.5 * real());
            const Vec3d eye = p.position + distance * glm::normalize(p.normal + 1.5 * aside);
            camera = lookFrom(eye, p.position, ground);
            if (ground.outside(eye)) break;
        }
        path.keys.push_back({double(i), camera});
        path.keys.push_back({i + 0.999, camera});
    }
    return path;
}

}  // namespace

std::optional<StandardPath> parseStandardPath(std::string_view name) {
    constexpr std::string_view kNames[] = {"orbit", "dive", "flight", "jumps", "inspection"};
    const auto found = std::find(std::begin(kNames), std::end(kNames), name);
    if (found == std::end(kNames)) return {};
    return StandardPath(found - std::begin(kNames));
}

Surface coarseSurface(std::span<const ModelReader* const> models, OpenLive open) {
    Surface surface;
    std::mutex mutex;
    const auto triangles = uint64_t(kSurfaceTriangles / double(models.size()));
    for (const ModelReader* model : models) {
        const Lattice& lattice = model->info().lattice;
        const auto add = [&](const Mesh& mesh, float error) {
            for (size_t i = 0; i < mesh.vertexCount(); ++i)
                surface.points.push_back({lattice.toInput(mesh.position[i]),
                                          Vec3d(decodeNormal(mesh.normal[i])),
                                          double(error) * lattice.step});
        };
        if (model->hasPatches()) {
            visitPatches(*model, cutByTriangles(model->nodes(), triangles).nodes,
                         [&](NodeIndex node, const Mesh& mesh) {
                             const std::lock_guard lock(mutex);
                             add(mesh, model->nodes()[node].error);
                         });
        } else {
            const std::unique_ptr<LiveModel> live = openLive(*model, open);
            refineEvenly(*model, *live, triangles);
            for (const LiveChunk& chunk : live->chunks()) add(chunk.mesh, chunk.error);
        }
    }
    // Patches come in any order.
    const auto key = [](const Surface::Point& p) {
        const auto& [x, n, error] = p;
        return std::tie(x.x, x.y, x.z, n.x, n.y, n.z, error);
    };
    std::sort(surface.points.begin(), surface.points.end(),
              [&](const auto& a, const auto& b) { return key(a) < key(b); });
    return surface;
}

CameraPath standardPath(StandardPath path, const Surface& surface, UpAxis up,
                        const PictureSize& size) {
    CHECK(!surface.points.empty());
    const Ground ground(surface, up, size);
    switch (path) {
        case StandardPath::kOrbit:
            return orbit(ground);
        case StandardPath::kDive:
            return dive(ground);
        case StandardPath::kFlight:
            return flight(ground);
        case StandardPath::kJumps:
            return jumps(ground);
        case StandardPath::kInspection:
            break;
    }
    return inspection(ground);
}

}  // namespace pietra
