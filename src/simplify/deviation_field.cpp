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
constexpr int kMaxOpen = 2 * FieldCover::kMaxHits + 4;

const IntLanes4 kFirst3 = {-1, -1, -1, 0};

Vec3f first3(Lanes4 v) {
    return {v[0], v[1], v[2]};
}

/// All ones in the lanes whose bit is set.
IntLanes4 lanesOf(uint32_t bits) {
    return (IntLanes4{1, 2, 4, 8} & int32_t(bits)) != 0;
}

}  // namespace

/// A target vertex seen from T.
struct FieldCover::Seen {
    Lanes4 at;         ///< barycentric coordinates with respect to the contracted T; height over T
    Lanes4 relative;   ///< position relative to T's first corner
    uint32_t outcode;  ///< bit i: beyond the side opposite to corner i
};

/// How the line from a to b, an edge of a face to its left, crosses the contracted T.
struct FieldCover::Crossing {
    bool meets;                          ///< the edge and T have points in common
    uint32_t right_corner, left_corner;  ///< corners of T that are certainly to the right, left;
                                         ///< none unless it meets
    float height;                        ///< largest of the common points; zero unless it meets

    // Everything is computed, whether needed or not: branches here would be taken at random.
    Crossing(const Seen& a, const Seen& b) {
        // Sides of T's corners, times the length; lanes: corners 2, 0, 1, zero. Written so that
        // short edges lose no accuracy.
        const Lanes4 along = b.at - a.at, along_rotated = rotate3(along);
        const Lanes4 side = a.at * along_rotated - rotate3(a.at) * along;
        const uint32_t negative = signBits(side) & 7;
        meets = uint32_t((a.outcode & b.outcode) == 0) & uint32_t(negative - 1 < 6u);
        const uint32_t mask = meets ? 7 : 0;
        const Lanes4 margin = kCornerMargin * (absLanes(along) + absLanes(along_rotated));
        const auto corners = [&](Lanes4 s) {
            const uint32_t rotated = signBits(s) & mask;
            return (rotated >> 1 | rotated << 2) & 7;
        };
        right_corner = corners(margin + side);
        left_corner = corners(margin - side);
        // Where it enters and leaves T.
        const Lanes4 t = a.at / (a.at - b.at);
        const Lanes4 enters = maskLanes(kFirst3 & (a.at < 0), t);
        const Lanes4 leaves = maskLanes(kFirst3 & (b.at < 0), 1.0f - t);
        const Lanes4 in = a.at + maxOf3(enters) * along;
        const Lanes4 out = b.at - maxOf3(leaves) * along;
        const float largest = maxLanes(absLanes(in), absLanes(out))[3];
        height = meets ? largest : 0.0f;
    }
};

struct FieldCover::Entry {
    Seen a, b;           ///< ends of the edge that is entered by, as the face to enter has them
    HalfEdge half_edge;  ///< of the face
    uint32_t beyond;     ///< corners of T certainly on the other side of it
    float height;        ///< of the edge
};

FieldCover::FieldCover() : stack_(std::make_unique<Entry[]>(kMaxOpen)) {}
FieldCover::~FieldCover() = default;

void FieldCover::setTarget(const Surface& target) {
    target_ = &target;
    visited_.assign(target.faceCount() + 1, 0);  // the last stands for no face
    run_ = 0;
}

inline FieldCover::Seen FieldCover::see(uint32_t vertex) {
    const Lanes4 w = loadLanes(target_->vertex(vertex).xyz0.data()) - chart_.origin;
    extent_ = maxLanes(extent_, absLanes(w));
    const Lanes4 at = chart_.constant + (chart_.x * w[0] + (chart_.y * w[1] + chart_.z * w[2]));
    return {at, w, signBits(at) & 7};
}

bool FieldCover::makeChart(const Surface& source, uint32_t t) {
    const Surface::Face& face = source.face(t);
    if (!(face.inverse_area > 0)) return false;
    Chart& c = chart_;
    c.origin = loadLanes(source.vertex(face.vertex[0]).xyz0.data());
    c.edge1 = loadLanes(source.vertex(face.vertex[1]).xyz0.data()) - c.origin;
    c.edge2 = loadLanes(source.vertex(face.vertex[2]).xyz0.data()) - c.origin;
    const Lanes4 normal = face.normalLanes();
    c.y = face.inverse_area * cross3(c.edge2, normal);
    c.z = face.inverse_area * cross3(normal, c.edge1);
    c.x = -c.y - c.z;
    Lanes4 rest = normal;
    transpose(c.x, c.y, c.z, rest);
    c.constant = Lanes4{1 - kContraction, -kContraction, -kContraction, 0};
    c.corner_x = kContraction * (c.edge1 + c.edge2);
    c.corner_y = c.corner_x + (1 - 3 * kContraction) * c.edge1;
    c.corner_z = c.corner_x + (1 - 3 * kContraction) * c.edge2;
    rest = normal;
    transpose(c.corner_x, c.corner_y, c.corner_z, rest);
    return true;
}

bool FieldCover::run(const Surface& source, uint32_t t, uint32_t start) {
    if (!makeChart(source, t)) return false;
    hit_count_ = 0;
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
            const float centre = sumOf3(cross3(seen[k].at, seen[nextCorner(k)].at));
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

// `corner`: one of the face's; `corners`: of T within the face, where its plane's height counts.
inline bool FieldCover::addHit(uint32_t f, const Seen& corner, float height, uint32_t corners) {
    const Surface::Face& face = target_->face(f);
    const Vec3f& n = face.normal;
    const Lanes4 along = chart_.corner_x * n.x + (chart_.corner_y * n.y + chart_.corner_z * n.z);
    const float level =
        corner.relative[0] * n.x + (corner.relative[1] * n.y + corner.relative[2] * n.z);
    const float cosine = along[3];
    const float at_corners = maxOf3(maskLanes(lanesOf(corners), absLanes(along - level))) / cosine;
    hits_[hit_count_++] = {f, std::max(height, at_corners), cosine};
    return cosine > kMinCosine && hit_count_ < kMaxHits;
}

bool FieldCover::flood(uint32_t start) {
    std::array<Seen, 3> seen;
    if (!findStart(start, seen)) return false;
    Entry* const stack = stack_.get();
    int open = 0;
    bool closed = true;  // no edge that T meets is without a neighbour
    const uint32_t run = run_;
    uint32_t* const visited = visited_.data();
    const auto enter = [&](const Crossing& crossing, const Seen& a, const Seen& b,
                           HalfEdge opposite) {
        closed &= !crossing.meets | opposite.exists();
        Entry& entry = stack[open];
        entry.a = b;
        entry.b = a;
        entry.half_edge = opposite;
        entry.beyond = crossing.left_corner;
        entry.height = crossing.height;
        uint32_t& mark = visited[opposite.exists() ? opposite.face() : target_->faceCount()];
        const bool fresh = crossing.meets & opposite.exists() & (mark != run);
        mark = crossing.meets ? run : mark;
        open += fresh;
    };
    visited[start] = run;
    const Surface::Face& first = target_->face(start);
    float height = 0;
    uint32_t corners = 7;
    for (int k = 0; k < 3; ++k) {
        const Seen &a = seen[k], &b = seen[nextCorner(k)];
        const Crossing crossing(a, b);
        height = std::max(height, crossing.height);
        corners &= ~crossing.right_corner;
        enter(crossing, a, b, first.opposite[k]);
    }
    if (!addHit(start, seen[0], height, corners)) return false;
    while (open > 0) {
        const Entry& top = stack[--open];  // to be overwritten by what is entered from here
        const Seen a = top.a, b = top.b;
        const uint32_t f = top.half_edge.face();
        const Surface::Face& face = target_->face(f);
        const uint32_t k1 = nextCorner(top.half_edge.edge()), k2 = nextCorner(k1);
        const Seen c = see(face.vertex[k2]);
        const Crossing first_crossing(b, c), second_crossing(c, a);
        height = std::max(std::max(top.height, first_crossing.height), second_crossing.height);
        corners = 7 & ~(top.beyond | first_crossing.right_corner | second_crossing.right_corner);
        enter(first_crossing, b, c, face.opposite[k1]);
        enter(second_crossing, c, a, face.opposite[k2]);
        if (!addHit(f, c, height, corners)) return false;
    }
    return closed;
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
