#include "simplify/deviation_partition.h"

#include <cmath>

namespace pietra::deviation {

namespace {

/// A piece moves over at most this many edges, then stays where it is.
constexpr int kMaxSteps = 7;
/// A face is cut into no more than about this many pieces.
constexpr size_t kMaxPieces = 96;

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
    float max_sq = 0;
    for (int i = 0; i < polygon.count; ++i) {
        max_sq = std::max(max_sq, squaredDistance(polygon.corner[i], triangle));
    }
    return std::sqrt(max_sq) + distanceSlack(polygon, triangle);
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
