#include "simplify/deviation_field.h"

#include <algorithm>
#include <cmath>

namespace pietra::deviation {

namespace {

constexpr float kContraction = 0x1p-14f;
/// Faces must look at least this much the same way.
constexpr float kMinCosine = 0.25f;
/// Largest product of a gradient and a coordinate. Barycentric coordinates err by some 2^-22 of it.
constexpr float kMaxReach = 256;
/// A corner of T within this of a face's edge, in barycentric coordinates, may be on either side.
constexpr float kCornerMargin = 0x1p-14f;

constexpr int kMaxWalk = 12;
constexpr size_t kMaxHits = 128;
constexpr int kMaxOpen = 64;

const IntLanes4 kFirst3 = {-1, -1, -1, 0};

Vec3f first3(Lanes4 v) {
    return {v[0], v[1], v[2]};
}

float dot3(const Vec3f& a, Lanes4 b) {
    return a.x * b[0] + a.y * b[1] + a.z * b[2];
}

}  // namespace

/// A target vertex seen from T.
struct FieldCover::Seen {
    Lanes4 at;         ///< barycentric coordinates with respect to the contracted T; height
    uint32_t outcode;  ///< bit i: beyond the side opposite to corner i
};

namespace {

using SeenLanes = Lanes4;

/// On which side of the line from a to b the corners of T lie: positive is left; times the length.
/// Lanes: corners 2, 0, 1, zero. Written so that short edges lose no accuracy.
struct EdgeSides {
    Lanes4 along, along_rotated, side;
    EdgeSides(SeenLanes a, SeenLanes b)
        : along(b - a),
          along_rotated(rotate3(along)),
          side(a * along_rotated - rotate3(a) * along) {}
    uint32_t negative() const { return signBits(side) & 7; }
    /// Bit i: corner i is certainly to the right.
    uint32_t excluded() const {
        const Lanes4 margin = kCornerMargin * (absLanes(along) + absLanes(along_rotated));
        const uint32_t rotated = signBits(side + margin) & 7;
        return (rotated >> 1 | rotated << 2) & 7;
    }
};

/// The largest height of the edge from a to b above the contracted T.
float edgeHeight(SeenLanes a, SeenLanes b) {
    const Lanes4 t = a / (a - b);
    const Lanes4 enters = maskLanes(kFirst3 & (a < 0), t);
    const Lanes4 leaves = maskLanes(kFirst3 & (b < 0), 1.0f - t);
    const float height = a[3], rise = b[3] - a[3];
    const float in = height + maxOf3(enters) * rise;
    const float out = height + (1 - maxOf3(leaves)) * rise;
    return std::max(std::abs(in), std::abs(out));
}

}  // namespace

struct FieldCover::Entry {
    HalfEdge half_edge;  ///< of the face to enter
    uint32_t excluded;   ///< corners of T beyond it, as the face sees it
    float height;        ///< of the edge
    Seen a, b;           ///< its ends, as the face has them
};

void FieldCover::setTarget(const Surface& target) {
    target_ = &target;
    visited_.assign(target.faceCount(), 0);
    run_ = 0;
}

FieldCover::Seen FieldCover::see(uint32_t vertex) {
    const Lanes4 w = loadLanes(target_->vertex(vertex).xyz0.data()) - chart_.origin;
    extent_ = maxLanes(extent_, absLanes(w));
    const Lanes4 at = chart_.constant + (chart_.x * w[0] + (chart_.y * w[1] + chart_.z * w[2]));
    return {at, signBits(at) & 7};
}

bool FieldCover::makeChart(const Surface& source, uint32_t t) {
    const Surface::Face& face = source.face(t);
    if (!(face.inverse_area > 0)) return false;
    chart_.origin = loadLanes(source.vertex(face.vertex[0]).xyz0.data());
    chart_.edge1 = loadLanes(source.vertex(face.vertex[1]).xyz0.data()) - chart_.origin;
    chart_.edge2 = loadLanes(source.vertex(face.vertex[2]).xyz0.data()) - chart_.origin;
    chart_.normal = face.normalLanes();
    const Lanes4 g1 = face.inverse_area * cross3(chart_.edge2, chart_.normal);
    const Lanes4 g2 = face.inverse_area * cross3(chart_.normal, chart_.edge1);
    chart_.x = -g1 - g2;
    chart_.y = g1;
    chart_.z = g2;
    Lanes4 rest = chart_.normal;
    transpose(chart_.x, chart_.y, chart_.z, rest);
    chart_.constant = Lanes4{1 - kContraction, -kContraction, -kContraction, 0};
    return true;
}

bool FieldCover::run(const Surface& source, uint32_t t, uint32_t start) {
    if (!makeChart(source, t)) return false;
    hits_.clear();
    ++run_;
    extent_ = Lanes4{};
    if (!flood(start)) return false;
    const Lanes4 gradient = maskLanes(
        kFirst3, maxLanes(maxLanes(absLanes(chart_.x), absLanes(chart_.y)), absLanes(chart_.z)));
    const float largest = maxOf3(extent_);
    const float reach = largest * maxOf3(gradient);
    if (!(reach <= kMaxReach)) return false;
    const float size = maxOf3(maxLanes(absLanes(chart_.edge1), absLanes(chart_.edge2)));
    slack_ = kDistanceSlack * largest + 4 * size * (kContraction + 0x1p-19f * reach);
    return true;
}

bool FieldCover::findStart(uint32_t& at, std::array<Seen, 3>& seen) {
    for (int step = 0; step < kMaxWalk; ++step) {
        const Surface::Face& face = target_->face(at);
        for (int k = 0; k < 3; ++k) seen[k] = see(face.vertex[k]);
        int out = -1;
        float worst = 0;
        for (int k = 0; k < 3; ++k) {
            const float centre = sumOf3(EdgeSides(seen[k].at, seen[nextCorner(k)].at).side);
            if (centre < worst) {
                worst = centre;
                out = k;
            }
        }
        if (out < 0) return true;
        if (!face.opposite[out].exists()) return false;
        at = face.opposite[out].face();
    }
    return false;
}

// The height of the face's plane at those corners of T.
float FieldCover::cornerHeight(const Surface::Face& face, float cosine, uint32_t corners) const {
    const Vec3f n = face.normal;
    const Lanes4 w = loadLanes(target_->vertex(face.vertex[0]).xyz0.data()) - chart_.origin;
    const float n1 = dot3(n, chart_.edge1), n2 = dot3(n, chart_.edge2);
    const float h0 = kContraction * (n1 + n2) - dot3(n, w);
    float height = 0;
    if (corners & 1) height = std::abs(h0);
    if (corners & 2) height = std::max(height, std::abs(h0 + (1 - 3 * kContraction) * n1));
    if (corners & 4) height = std::max(height, std::abs(h0 + (1 - 3 * kContraction) * n2));
    return height / cosine;
}

bool FieldCover::flood(uint32_t start) {
    Entry stack[kMaxOpen];
    int open = 0;
    float height = 0;
    uint32_t corners = 0;
    // The edge from a to b of the current face: if T meets it, its heights count, and the neighbour
    // is to be entered. False: there is none.
    const auto cross = [&](const Seen& a, const Seen& b, HalfEdge opposite) {
        if ((a.outcode & b.outcode) != 0) return true;
        const EdgeSides sides(a.at, b.at);
        const uint32_t negative = sides.negative();
        if (negative == 0 || negative == 7) return true;
        const float edge_height = edgeHeight(a.at, b.at);
        height = std::max(height, edge_height);
        corners &= ~sides.excluded();
        if (!opposite.exists() || open == kMaxOpen) return false;
        uint32_t& mark = visited_[opposite.face()];
        if (mark == run_) return true;
        mark = run_;
        stack[open++] = {opposite, EdgeSides(b.at, a.at).excluded(), edge_height, b, a};
        return true;
    };
    const auto close = [&](const Surface::Face& face, uint32_t f, float cosine) {
        if (corners != 0) height = std::max(height, cornerHeight(face, cosine, corners));
        hits_.push_back({f, height, cosine});
    };
    const Vec3f normal = first3(chart_.normal);

    std::array<Seen, 3> seen;
    if (!findStart(start, seen)) return false;
    visited_[start] = run_;
    corners = 7;
    const Surface::Face& first = target_->face(start);
    const float first_cosine = glm::dot(first.normal, normal);
    if (!(first_cosine > kMinCosine)) return false;
    for (int k = 0; k < 3; ++k) {
        if (!cross(seen[k], seen[nextCorner(k)], first.opposite[k])) return false;
    }
    close(first, start, first_cosine);

    while (open > 0) {
        const Entry entry = stack[--open];
        const uint32_t f = entry.half_edge.face();
        const Surface::Face& face = target_->face(f);
        const float cosine = glm::dot(face.normal, normal);
        if (!(cosine > kMinCosine) || hits_.size() == kMaxHits) return false;
        const uint32_t k1 = nextCorner(entry.half_edge.edge()), k2 = nextCorner(k1);
        const Seen c = see(face.vertex[k2]);
        height = entry.height;
        corners = 7 & ~entry.excluded;
        if (!cross(entry.b, c, face.opposite[k1])) return false;
        if (!cross(c, entry.a, face.opposite[k2])) return false;
        close(face, f, cosine);
    }
    return true;
}

// Clips the contracted T, whose corners are the unit vectors, by the three edges of the face. A
// margin keeps what rounding might lose.
bool FieldCover::overlap(uint32_t face, Polygon& polygon) const {
    Polygon now{3, {Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(0, 0, 1)}};
    for (int k = 0; k < 3; ++k) {
        const auto seen = [&](uint32_t v) {
            const Lanes4 w = loadLanes(target_->vertex(v).xyz0.data()) - chart_.origin;
            return first3(chart_.constant +
                          (chart_.x * w[0] + (chart_.y * w[1] + chart_.z * w[2])));
        };
        const Vec3f from = seen(target_->face(face).vertex[k]);
        const Vec3f along = seen(target_->face(face).vertex[nextCorner(k)]) - from;
        const Vec3f side = glm::cross(from, along);
        const auto largest = [](const Vec3f& v) {
            return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
        };
        const float margin = 0x1p-20f * largest(from) * largest(along);
        Polygon next;
        std::array<float, Polygon::kMaxCorners> s;
        for (int i = 0; i < now.count; ++i) s[i] = glm::dot(side, now.corner[i]) + margin;
        for (int i = 0; i < now.count; ++i) {
            const int j = i + 1 < now.count ? i + 1 : 0;
            if (next.count + 2 > Polygon::kMaxCorners) return false;
            if (s[i] >= 0) next.add(now.corner[i]);
            if ((s[i] < 0) != (s[j] < 0)) {
                next.add(now.corner[i] + s[i] / (s[i] - s[j]) * (now.corner[j] - now.corner[i]));
            }
        }
        now = next;
    }
    const Vec3f e1 = first3(chart_.edge1), e2 = first3(chart_.edge2);
    polygon.count = 0;
    for (int i = 0; i < now.count; ++i) {
        const Vec3f& c = now.corner[i];
        polygon.add((kContraction + (1 - 3 * kContraction) * c.y) * e1 +
                    (kContraction + (1 - 3 * kContraction) * c.z) * e2);
    }
    return true;
}

}  // namespace pietra::deviation
