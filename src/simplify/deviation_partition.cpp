#include "simplify/deviation_partition.h"

#include <algorithm>
#include <cmath>

#include "simplify/lanes4.h"

namespace pietra::deviation {

namespace {

/// A piece moves over at most this many edges, then stays where it is.
constexpr int kMaxSteps = 7;
/// A face is cut into no more than about this many pieces.
constexpr size_t kMaxPieces = 96;

/// Four points, or four times the same one.
struct Points4 {
    Lanes4 x, y, z;

    static Points4 all(const Vec3f& p) {
        const auto four = [](float a) { return Lanes4{a, a, a, a}; };
        return {four(p.x), four(p.y), four(p.z)};
    }
    /// Four corners from `first` on; beyond the last the first one.
    static Points4 corners(const Polygon& polygon, int first) {
        const auto at = [&](int i) -> const Vec3f& {
            return polygon.corner[first + i < polygon.count ? first + i : 0];
        };
        const Vec3f &a = at(0), &b = at(1), &c = at(2), &d = at(3);
        return {Lanes4{a.x, b.x, c.x, d.x}, Lanes4{a.y, b.y, c.y, d.y}, Lanes4{a.z, b.z, c.z, d.z}};
    }
};

Points4 operator-(const Points4& a, const Points4& b) {
    return {a.x - b.x, a.y - b.y, a.z - b.z};
}
Points4 operator*(Lanes4 t, const Points4& a) {
    return {t * a.x, t * a.y, t * a.z};
}
Lanes4 dot(const Points4& a, const Points4& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}
float largest(Lanes4 v) {
    return std::max(std::max(v[0], v[1]), std::max(v[2], v[3]));
}
Lanes4 minLanes(Lanes4 a, Lanes4 b) {
    return -maxLanes(-a, -b);
}

/// squaredDistance() of geometry/triangle_distance.h, to the bit, of four points at once.
class SquaredDistances {
public:
    explicit SquaredDistances(const LocalTriangle& t)
        : normal_(Points4::all(t.normal)), has_normal_(glm::dot(t.normal, t.normal) > 0.5f) {
        const std::array from{t.a, t.b, t.c}, edge{t.b - t.a, t.c - t.b, t.a - t.c};
        for (int k = 0; k < 3; ++k) {
            edge_[k] = {Points4::all(from[k]), Points4::all(edge[k]),
                        Points4::all(glm::cross(t.normal, edge[k])), glm::dot(edge[k], edge[k])};
        }
    }

    Lanes4 operator()(const Points4& p) const {
        Lanes4 least{HUGE_VALF, HUGE_VALF, HUGE_VALF, HUGE_VALF};
        IntLanes4 inside = IntLanes4{-1, -1, -1, -1} & (has_normal_ ? -1 : 0);
        for (const Edge& edge : edge_) {
            const Points4 w = p - edge.from;
            inside &= dot(edge.inward, w) >= 0;
            const Lanes4 t = edge.length_sq > 0 ? dot(w, edge.along) / edge.length_sq : Lanes4{};
            const Lanes4 part = minLanes(maxLanes(t, Lanes4{}), Lanes4{1, 1, 1, 1});
            const Points4 rest = w - part * edge.along;
            least = minLanes(least, dot(rest, rest));
        }
        const Lanes4 height = dot(normal_, p - edge_[0].from);
        return maskLanes(inside, height * height) + maskLanes(~inside, least);
    }

private:
    struct Edge {
        Points4 from, along, inward;
        float length_sq;
    };
    std::array<Edge, 3> edge_;
    Points4 normal_;
    bool has_normal_;
};

/// Sums of a few positive floats, rounded up.
float sumUp(float a, float b, float c) {
    return (a + b + c) * (1 + 0x1p-21f);
}

}  // namespace

bool splitPolygon(const Polygon& polygon, const Vec3f& point, const Vec3f& normal, Polygon& above,
                  Polygon& below) {
    above.count = below.count = 0;
    std::array<float, Polygon::kMaxCorners> side;
    for (int i = 0; i < polygon.count; ++i) side[i] = glm::dot(normal, polygon.corner[i] - point);
    for (int i = 0; i < polygon.count; ++i) {
        const int j = i + 1 < polygon.count ? i + 1 : 0;
        const Vec3f& p = polygon.corner[i];
        if (above.count + 2 > Polygon::kMaxCorners || below.count + 2 > Polygon::kMaxCorners) {
            return false;
        }
        if (side[i] >= 0) above.add(p);
        if (side[i] <= 0) below.add(p);
        if ((side[i] > 0 && side[j] < 0) || (side[i] < 0 && side[j] > 0)) {
            const Vec3f cut = p + (side[i] / (side[i] - side[j])) * (polygon.corner[j] - p);
            above.add(cut);
            below.add(cut);
        }
    }
    return true;
}

float distanceSlack(const Polygon& polygon, const LocalTriangle& triangle) {
    Vec3f extent =
        glm::max(glm::max(glm::abs(triangle.a), glm::abs(triangle.b)), glm::abs(triangle.c));
    for (int i = 0; i < polygon.count; ++i) extent = glm::max(extent, glm::abs(polygon.corner[i]));
    return kDistanceSlack * std::max({extent.x, extent.y, extent.z});
}

int farthestCorner(const Polygon& polygon, const LocalTriangle& triangle) {
    int farthest = 0;
    float max_sq = -1;
    for (int i = 0; i < polygon.count; ++i) {
        const float d = squaredDistance(polygon.corner[i], triangle);
        if (d > max_sq) {
            max_sq = d;
            farthest = i;
        }
    }
    return farthest;
}

float maxCornerDistance(const Polygon& polygon, const LocalTriangle& triangle) {
    const SquaredDistances squared(triangle);
    const Vec3f at =
        glm::max(glm::max(glm::abs(triangle.a), glm::abs(triangle.b)), glm::abs(triangle.c));
    Lanes4 max_sq{}, extent = {at.x, at.y, at.z, 0};
    for (int i = 0; i < polygon.count; i += 4) {
        const Points4 points = Points4::corners(polygon, i);
        max_sq = maxLanes(max_sq, squared(points));
        for (const Lanes4& a : {points.x, points.y, points.z})
            extent = maxLanes(extent, absLanes(a));
    }
    return std::sqrt(largest(max_sq)) + kDistanceSlack * largest(extent);
}

float Partition::value(const Polygon& polygon, const Vec3f& origin, float base,
                       uint32_t target) const {
    return sumUp(base, offset_.empty() ? 0.0f : offset_[target],
                 maxCornerDistance(polygon, target_->local(target, origin)));
}

// The plane through the edge that holds the bisector of both normals: on it both faces are equally
// far. What lies outside becomes a new item for the neighbour.
bool Partition::cutAtEdge(Item& item, int edge, const Vec3f& origin) {
    const Surface::Face& face = target_->face(item.face);
    const HalfEdge opposite = face.opposite[edge];
    if (!opposite.exists() || uint32_t(edge) == item.from_edge) return false;
    const Vec3f a = target_->position(face.vertex[edge]) - origin;
    const Vec3f b = target_->position(face.vertex[nextCorner(edge)]) - origin;
    const Vec3f bisector = face.normal() + target_->face(opposite.face()).normal();
    const Vec3f inward = glm::cross(bisector, b - a);
    if (glm::dot(inward, inward) <= 1e-4f * glm::dot(b - a, b - a)) return false;
    Polygon inside, outside;
    if (!splitPolygon(item.polygon, a, inward, inside, outside) || outside.count < 3) return false;
    stack_.push_back({outside, opposite.face(), opposite.edge(), item.steps + 1});
    item.polygon = inside;
    return true;
}

void Partition::cover(const Polygon& polygon, const Vec3f& origin, uint32_t source, float base,
                      uint32_t start, float limit, std::vector<Piece>& out) {
    const size_t first = out.size();
    stack_.clear();
    stack_.push_back({polygon, start, 3, 0});
    while (!stack_.empty()) {
        Item item = stack_.back();
        stack_.pop_back();
        float reached = value(item.polygon, origin, base, item.face);
        if (reached > limit && item.steps < kMaxSteps &&
            out.size() - first + stack_.size() < kMaxPieces) {
            bool cut = false;
            for (int edge = 0; edge < 3 && item.polygon.count >= 3; ++edge) {
                cut |= cutAtEdge(item, edge, origin);
            }
            if (item.polygon.count < 3) continue;
            if (cut) reached = value(item.polygon, origin, base, item.face);
        }
        out.push_back({item.polygon, source, item.face, base, reached});
    }
}

}  // namespace pietra::deviation
