#include "simplify/deviation_field.h"

#include <algorithm>
#include <cmath>

#include "simplify/lanes4.h"

namespace pietra::deviation {

namespace {

constexpr int kMaxWalk = 12;
constexpr size_t kMaxHits = 128;
constexpr int kMaxOpen = 64;
/// Faces must look at least this much the same way.
constexpr float kMinCosine = 0.25f;
/// Largest product of a gradient and a coordinate: keeps the error of barycentric coordinates, some
/// 2^-22 of it, well below the dilation.
constexpr float kMaxReach = 256;

float largestComponent(const Vec3f& v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

}  // namespace

/// A target vertex seen from T. `coordinate`: barycentric 0, 1, 2, height; `rotated`: 1, 2, 0,
/// zero.
struct FieldCover::Seen {
    Lanes4 coordinate, rotated;
    /// On which side of the line from a to b the corners of T lie: positive is left. The lanes are
    /// corners 2, 0, 1, and zero.
    static Lanes4 sides(const Seen& a, const Seen& b) {
        return a.coordinate * (b.rotated - a.rotated) - a.rotated * (b.coordinate - a.coordinate);
    }
};

struct FieldCover::Entry {
    HalfEdge half_edge;  ///< of the face to enter
    Seen a, b;           ///< its ends
};

/// The affine map from the target's space to Seen.
struct FieldCover::Chart {
    Lanes4 origin, x, y, z, constant, rx, ry, rz, rconstant;
    Vec3f normal;
    float reach = 0;  ///< largest gradient
    mutable Lanes4 extent = Lanes4{};

    Seen see(const Surface::Vertex& v) const {
        const Lanes4 w = loadLanes(v.xyz0.data()) - origin;
        extent = maxLanes(extent, absLanes(w));
        const float wx = w[0], wy = w[1], wz = w[2];
        return {constant + (x * wx + (y * wy + z * wz)),
                rconstant + (rx * wx + (ry * wy + rz * wz))};
    }
};

FieldCover::FieldCover() = default;

void FieldCover::setTarget(const Surface& target) {
    target_ = &target;
    visited_.assign(target.faceCount(), 0);
    run_ = 0;
}

bool FieldCover::run(const Surface& source, uint32_t t, uint32_t start) {
    const Surface::Face& face = source.face(t);
    const Surface::Vertex& origin = source.vertex(face.vertex[0]);
    const Vec3f e1 = source.corner(t, 1) - source.corner(t, 0);
    const Vec3f e2 = source.corner(t, 2) - source.corner(t, 0);
    const Vec3f n = face.normal;
    const Vec3f g1 = face.inverse_area * glm::cross(e2, n);
    const Vec3f g2 = face.inverse_area * glm::cross(n, e1);
    const Vec3f g0 = -g1 - g2;
    Chart chart;
    chart.normal = n;
    chart.origin = loadLanes(origin.xyz0.data());
    const auto lanes = [](float a, float b, float c, float d) {
        alignas(16) const float v[4] = {a, b, c, d};
        return loadLanes(v);
    };
    chart.x = lanes(g0.x, g1.x, g2.x, n.x);
    chart.y = lanes(g0.y, g1.y, g2.y, n.y);
    chart.z = lanes(g0.z, g1.z, g2.z, n.z);
    chart.constant = lanes(1 - kContraction, -kContraction, -kContraction, 0);
    chart.rx = lanes(g1.x, g2.x, g0.x, 0);
    chart.ry = lanes(g1.y, g2.y, g0.y, 0);
    chart.rz = lanes(g1.z, g2.z, g0.z, 0);
    chart.rconstant = lanes(-kContraction, -kContraction, 1 - kContraction, 0);
    if (!(face.inverse_area > 0)) return false;
    hits_.clear();
    ++run_;
    if (!flood(chart, start)) return false;
    alignas(16) float extent[4];
    storeLanes(chart.extent, extent);
    const float largest = std::max({extent[0], extent[1], extent[2]});
    const float gradient =
        std::max({largestComponent(g0), largestComponent(g1), largestComponent(g2)});
    const float reach = largest * gradient;
    if (!(reach <= kMaxReach)) return false;
    const float size = largestComponent(glm::max(glm::abs(e1), glm::abs(e2)));
    origin_ = source.corner(t, 0);
    normal_ = n;
    slack_ = kDistanceSlack * largest + 4 * size * (kContraction + 0x1p-19f * reach);
    const Vec3f shift = kContraction * (e1 + e2);
    corner_ = {shift, (1 - 3 * kContraction) * e1 + shift, (1 - 3 * kContraction) * e2 + shift};
    return true;
}

bool FieldCover::flood(const Chart& chart, uint32_t start) {
    const auto sum = [](Lanes4 v) {
        alignas(16) float a[4];
        storeLanes(v, a);
        return a[0] + a[1] + a[2];
    };
    // Walk to the face over the centre of T.
    std::array<Seen, 3> seen;
    std::array<Lanes4, 3> side;
    uint32_t at = start;
    for (int step = 0;; ++step) {
        const Surface::Face& face = target_->face(at);
        for (int k = 0; k < 3; ++k) seen[k] = chart.see(target_->vertex(face.vertex[k]));
        int out = -1;
        float worst = 0;
        for (int k = 0; k < 3; ++k) {
            side[k] = Seen::sides(seen[k], seen[nextCorner(k)]);
            const float s = sum(side[k]);
            if (s < worst) {
                worst = s;
                out = k;
            }
        }
        if (out < 0) break;
        if (step == kMaxWalk || !face.opposite[out].exists()) return false;
        at = face.opposite[out].face();
    }
    Entry stack[kMaxOpen];
    int open = 0;
    const auto hit = [&](uint32_t f, const Seen& a, const Seen& b, const Seen& c) {
        Hit h;
        storeLanes(a.coordinate, h.corner[0].data());
        storeLanes(b.coordinate, h.corner[1].data());
        storeLanes(c.coordinate, h.corner[2].data());
        h.face = f;
        h.height = std::max(
            {std::abs(h.corner[0][3]), std::abs(h.corner[1][3]), std::abs(h.corner[2][3])});
        hits_.push_back(h);
    };
    // The edge from a to b is met by T: neither is all of T on one side, nor the edge beyond a
    // side.
    const auto meets = [&](uint32_t negative, const Seen& a, const Seen& b) {
        return negative != 0 && negative != 7 &&
               (signBits(a.coordinate) & signBits(b.coordinate) & 7) == 0;
    };
    const auto push = [&](HalfEdge opposite, const Seen& a, const Seen& b) {
        if (!opposite.exists() || open == kMaxOpen) return false;
        uint32_t& mark = visited_[opposite.face()];
        if (mark == run_) return true;
        mark = run_;
        stack[open++] = {opposite, b, a};
        return true;
    };
    {
        const Surface::Face& face = target_->face(at);
        visited_[at] = run_;
        if (!(glm::dot(face.normal, chart.normal) > kMinCosine)) return false;
        hit(at, seen[0], seen[1], seen[2]);
        for (int k = 0; k < 3; ++k) {
            const Seen &a = seen[k], &b = seen[nextCorner(k)];
            if (meets(signBits(side[k]) & 7, a, b) && !push(face.opposite[k], a, b)) return false;
        }
    }
    while (open > 0) {
        const Entry entry = stack[--open];
        const uint32_t f = entry.half_edge.face(), edge = entry.half_edge.edge();
        const Surface::Face& face = target_->face(f);
        if (!(glm::dot(face.normal, chart.normal) > kMinCosine)) return false;
        const uint32_t k1 = nextCorner(edge), k2 = nextCorner(k1);
        const Seen c = chart.see(target_->vertex(face.vertex[k2]));
        const uint32_t s1 = signBits(Seen::sides(entry.b, c)) & 7;
        const uint32_t s2 = signBits(Seen::sides(c, entry.a)) & 7;
        if (s1 != 7 && s2 != 7) {
            if (hits_.size() == kMaxHits) return false;
            hit(f, entry.a, entry.b, c);
        }
        if (meets(s1, entry.b, c) && !push(face.opposite[k1], entry.b, c)) return false;
        if (meets(s2, c, entry.a) && !push(face.opposite[k2], c, entry.a)) return false;
    }
    return true;
}

// Height is linear over the overlap, so largest where an edge of the face enters or leaves T, at
// corners of the face within T, and at corners of T within the face. Those of T that are outside by
// no more than rounding may decide count as inside.
float FieldCover::overlapHeight(const Hit& hit) const {
    float height = 0;
    uint32_t outside = 0;
    for (int k = 0; k < 3; ++k) {
        const Lanes4 a = loadLanes(hit.corner[k].data());
        const Lanes4 d = loadLanes(hit.corner[nextCorner(k)].data()) - a;
        float enter = 0, leave = 1;
        float along = 0;
        for (int i = 0; i < 3; ++i) {
            along = std::max(along, std::abs(d[i]));
            const float t = -a[i] / d[i];
            if (d[i] > 0) enter = std::max(enter, t);
            if (d[i] < 0) leave = std::min(leave, t);
            if (d[i] == 0 && a[i] < 0) leave = -1;
        }
        if (enter <= leave) {
            height =
                std::max({height, std::abs(a[3] + enter * d[3]), std::abs(a[3] + leave * d[3])});
        }
        const float margin = -0x1p-12f * along;
        outside |= uint32_t(a[1] * d[2] - a[2] * d[1] < margin);
        outside |= uint32_t(a[2] * d[0] - a[0] * d[2] < margin) << 1;
        outside |= uint32_t(a[0] * d[1] - a[1] * d[0] < margin) << 2;
    }
    if (outside == 7) return height;
    const Vec3f n = target_->face(hit.face).normal;
    const Vec3f v = target_->corner(hit.face, 0) - origin_;
    const float cosine = glm::dot(n, normal_);
    for (int i = 0; i < 3; ++i) {
        if (outside >> i & 1) continue;
        height = std::max(height, std::abs(glm::dot(n, corner_[i] - v)) / cosine);
    }
    return height;
}

// Clips the enlarged T, whose corners are the unit vectors, by the three edges of the face. A
// margin far below the dilation keeps what rounding might lose.
bool FieldCover::overlap(const Hit& hit, Polygon& polygon) const {
    struct Clipped {
        int count = 0;
        std::array<Vec3f, 8> corner;
    };
    Clipped now;
    now.count = 3;
    now.corner = {Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(0, 0, 1)};
    for (int k = 0; k < 3; ++k) {
        const auto &a = hit.corner[k], &b = hit.corner[nextCorner(k)];
        const Vec3f from(a[0], a[1], a[2]), along(b[0] - a[0], b[1] - a[1], b[2] - a[2]);
        const Vec3f side = glm::cross(from, along);
        const float margin = 0x1p-20f * largestComponent(from) * largestComponent(along);
        if (now.count > 6) return false;
        Clipped next;
        std::array<float, 8> s;
        for (int i = 0; i < now.count; ++i) s[i] = glm::dot(side, now.corner[i]) + margin;
        for (int i = 0; i < now.count; ++i) {
            const int j = i + 1 < now.count ? i + 1 : 0;
            if (next.count == 8) return false;
            if (s[i] >= 0) next.corner[next.count++] = now.corner[i];
            if ((s[i] < 0) != (s[j] < 0)) {
                if (next.count == 8) return false;
                next.corner[next.count++] =
                    now.corner[i] + s[i] / (s[i] - s[j]) * (now.corner[j] - now.corner[i]);
            }
        }
        now = next;
    }
    polygon.count = 0;
    for (int i = 0; i < now.count; ++i) {
        const Vec3f& c = now.corner[i];
        polygon.add(c.x * corner_[0] + c.y * corner_[1] + c.z * corner_[2]);
    }
    return true;
}

}  // namespace pietra::deviation
