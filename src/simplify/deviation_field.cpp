#include "simplify/deviation_field.h"

#include <algorithm>
#include <bit>
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

/// Bits of lanes 1 to 3.
constexpr uint32_t kPointBits = 14;

Vec3f pointOf(Lanes4 v) {
    return {v[1], v[2], v[3]};
}

/// All ones in the lanes whose bit is set.
IntLanes4 lanesOf(uint32_t bits) {
    return (IntLanes4{1, 2, 4, 8} & int32_t(bits)) != 0;
}

}  // namespace

/// How an edge from a to b, with its face on the left, crosses the contracted T. Everything is
/// computed, whether needed or not: branches here would go either way at random.
struct FieldCover::Crossing {
    uint32_t meets;        ///< 1 if the edge and T have points in common, else 0
    uint32_t right, left;  ///< if it meets: corners of T that are certainly to the right, left;
                           ///< bits as the lanes of Chart::corner_x
    float height;  ///< if it meets: the largest of the common points; else 0
    float centre;  ///< not negative if T's centre is to the left

    Crossing(Lanes4 a, Lanes4 b) {
        // Sides of T's corners 2, 0, 1, times the length. Short edges lose no accuracy this way.
        const Lanes4 along = b - a, along_rotated = rotate(along);
        const Lanes4 side = a * along_rotated - rotate(a) * along;
        const uint32_t negative = signBits(side);
        meets = uint32_t((signBits(a) & signBits(b) & kPointBits) == 0) &
                uint32_t(negative - 2 <= kPointBits - 4);
        centre = sumOfPoint(side)[1];

        const uint32_t mask = (0u - meets) & kPointBits;
        const Lanes4 margin = kCornerMargin * (absLanes(along) + absLanes(along_rotated));
        right = signBits(margin + side) & mask;
        left = signBits(margin - side) & mask;

        const Lanes4 t = a / (a - b);  // where it crosses the sides
        const Lanes4 enters = maskLanes(a < 0, t), leaves = maskLanes(b < 0, 1.0f - t);
        const Lanes4 part = maxOfPoints(enters, leaves);
        const float in = a[0] + part[0] * along[0], out = b[0] - part[1] * along[0];
        const float largest = std::max(std::abs(in), std::abs(out));
        height = std::bit_cast<float>(std::bit_cast<uint32_t>(largest) & (0u - meets));
    }
};

/// A face still to be looked at, entered across the edge from a to b.
struct FieldCover::Entry {
    Lanes4 a, b;
    uint32_t face, edge;
    uint32_t beyond;  ///< corners of T certainly on the other side of the edge
    float height;     ///< of the edge
    float centre;     ///< not negative if T's centre is on the face's side
};

FieldCover::FieldCover() : queue_(std::make_unique<Entry[]>(2 * kMaxHits + 4)) {}
FieldCover::~FieldCover() = default;

void FieldCover::setTarget(const Surface& target) {
    target_ = &target;
    visited_.assign(target.faceCount() + 1, 0);
    run_ = 0;
}

bool FieldCover::makeChart(const Surface& source, uint32_t t) {
    const Surface::Face& face = source.face(t);
    const Lanes4 normal = loadLanes(face.area_normal.data());
    if (!(normal[0] > 0)) return false;
    Chart& c = chart_;
    c.origin = loadLanes(source.vertex(face.vertex[0]).lanes.data());
    c.edge1 = loadLanes(source.vertex(face.vertex[1]).lanes.data()) - c.origin;
    c.edge2 = loadLanes(source.vertex(face.vertex[2]).lanes.data()) - c.origin;
    // Rows: the normal and the gradients of the coordinates; then columns.
    const Lanes4 inverse_area = broadcast<0>(normal);
    Lanes4 nothing = normal;
    c.y = inverse_area * crossPoints(c.edge2, normal);
    c.z = inverse_area * crossPoints(normal, c.edge1);
    c.x = -c.y - c.z;
    transpose(nothing, c.x, c.y, c.z);
    c.constant = Lanes4{0, 1 - kContraction, -kContraction, -kContraction};
    nothing = normal;
    c.corner_y = kContraction * (c.edge1 + c.edge2);
    c.corner_z = c.corner_y + (1 - 3 * kContraction) * c.edge1;
    c.corner_x = c.corner_y + (1 - 3 * kContraction) * c.edge2;
    transpose(nothing, c.corner_x, c.corner_y, c.corner_z);
    return true;
}

inline Lanes4 FieldCover::relative(uint32_t vertex) const {
    return loadLanes(target_->vertex(vertex).lanes.data()) - chart_.origin;
}

inline Lanes4 FieldCover::see(Lanes4 w) const {
    return chart_.constant +
           (chart_.x * broadcast<1>(w) + (chart_.y * broadcast<2>(w) + chart_.z * broadcast<3>(w)));
}

bool FieldCover::run(const Surface& source, uint32_t t, uint32_t start) {
    if (!makeChart(source, t)) return false;
    bool centre_met = false;
    if (!flood(start, centre_met)) return false;
    if (centre_met) return true;
    return findStart(start) && flood(start, centre_met) && centre_met;
}

float FieldCover::slackOf(Lanes4 extent) const {
    const Lanes4 gradient =
        maxLanes(maxLanes(absLanes(chart_.x), absLanes(chart_.y)), absLanes(chart_.z));
    const Lanes4 size = maxLanes(absLanes(chart_.edge1), absLanes(chart_.edge2));
    const Lanes4 extent_gradient = maxOfPoints(extent, gradient);
    const float reach = extent_gradient[0] * extent_gradient[1];
    if (!(reach <= kMaxReach)) return -1;
    return kDistanceSlack * extent_gradient[0] +
           4 * maxOfPoint(size)[1] * (kContraction + 0x1p-19f * reach);
}

/// Walks towards T's centre.
bool FieldCover::findStart(uint32_t& at) const {
    for (int step = 0; step < kMaxWalk; ++step) {
        const Surface::Face& face = target_->face(at);
        std::array<Lanes4, 3> seen;
        for (int k = 0; k < 3; ++k) seen[k] = see(relative(face.vertex[k]));
        int out = -1;
        float worst = 0;
        for (int k = 0; k < 3; ++k) {
            const float centre = sumOfPoint(crossPoints(seen[k], seen[nextCorner(k)]))[1];
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

// `corner`: one of the face's, relative; `corners`: of T within the face, where its plane counts.
inline FieldCover::Hit FieldCover::makeHit(uint32_t f, Lanes4 corner, float height,
                                           uint32_t corners) const {
    const Lanes4 normal = loadLanes(target_->face(f).area_normal.data());
    const Lanes4 along =
        chart_.corner_x * broadcast<1>(normal) +
        (chart_.corner_y * broadcast<2>(normal) + chart_.corner_z * broadcast<3>(normal));
    const Lanes4 level = broadcast<1>(sumOfPoint(corner * normal));
    const Lanes4 above = maskLanes(lanesOf(corners), absLanes(along - level));
    const float cosine = along[0];
    return {f, std::max(height, maxOfPoint(above)[1] / cosine), cosine};
}

bool FieldCover::flood(uint32_t start, bool& centre_met) {
    const uint32_t run = ++run_, no_face = target_->faceCount();
    uint32_t* const visited = visited_.data();
    Entry* const queue = queue_.get();
    uint32_t queued = 0, hits = 0;
    // If T meets the edge from a to b, the face across it is queued.
    const auto enter = [&](const Crossing& crossing, Lanes4 a, Lanes4 b, HalfEdge opposite) {
        const uint32_t face = std::min(opposite.face(), no_face);
        Entry& entry = queue[queued];
        entry.a = b;
        entry.b = a;
        entry.face = face;
        entry.edge = opposite.edge();
        entry.beyond = crossing.left;
        entry.height = crossing.height;
        entry.centre = -crossing.centre;
        const uint32_t mark = visited[face];
        queued += crossing.meets & uint32_t(mark != run);
        visited[face] = mark ^ ((mark ^ run) & (0u - crossing.meets));
    };

    // The first face is entered by its own first edge, whose other side is queued if T meets it.
    const Surface::Face& first = target_->face(start);
    const Lanes4 w0 = relative(first.vertex[0]), w1 = relative(first.vertex[1]);
    const Lanes4 first_a = see(w0), first_b = see(w1);
    const Crossing first_edge(first_a, first_b);
    Lanes4 extent = maxLanes(absLanes(w0), absLanes(w1));
    visited[start] = run;
    queue[queued++] = {first_a,           first_b,          start, 0, first_edge.right,
                       first_edge.height, first_edge.centre};
    enter(first_edge, first_a, first_b, first.opposite[0]);

    // First in, first out: so the processor can begin with the next while this one is being
    // decided.
    bool centre = false;
    for (uint32_t next = 0; next < queued; ++next) {
        const Entry& entry = queue[next];
        const uint32_t f = entry.face;
        if (f == no_face || hits == kMaxHits) return false;
        const Surface::Face& face = target_->face(f);
        const uint32_t k1 = nextCorner(entry.edge), k2 = nextCorner(k1);
        const Lanes4 w = relative(face.vertex[k2]);
        extent = maxLanes(extent, absLanes(w));
        const Lanes4 c = see(w);
        const Crossing leave1(entry.b, c), leave2(c, entry.a);
        const float height = std::max(std::max(entry.height, leave1.height), leave2.height);
        const uint32_t corners = kPointBits & ~(entry.beyond | leave1.right | leave2.right);
        const Hit hit = makeHit(f, w, height, corners);
        hits_[hits++] = hit;
        if (!(hit.cosine > kMinCosine)) return false;
        centre |= std::min(std::min(entry.centre, leave1.centre), leave2.centre) >= 0;
        const Lanes4 a = entry.a;
        enter(leave1, entry.b, c, face.opposite[k1]);
        enter(leave2, c, a, face.opposite[k2]);
    }
    hit_count_ = hits;
    centre_met |= centre;
    slack_ = slackOf(extent);
    return slack_ >= 0;
}

// Clips the contracted T, whose corners are the unit vectors, by the three edges of the face. A
// margin keeps what rounding might lose.
bool FieldCover::overlap(uint32_t face, Polygon& polygon) const {
    Polygon now{3, {Vec3f(1, 0, 0), Vec3f(0, 1, 0), Vec3f(0, 0, 1)}};
    const auto& vertex = target_->face(face).vertex;
    for (int k = 0; k < 3; ++k) {
        const Vec3f from = pointOf(see(relative(vertex[k])));
        const Vec3f along = pointOf(see(relative(vertex[nextCorner(k)]))) - from;
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
    const Vec3f e1 = pointOf(chart_.edge1), e2 = pointOf(chart_.edge2);
    polygon.count = 0;
    for (int i = 0; i < now.count; ++i) {
        const Vec3f& c = now.corner[i];
        polygon.add((kContraction + (1 - 3 * kContraction) * c.y) * e1 +
                    (kContraction + (1 - 3 * kContraction) * c.z) * e2);
    }
    return true;
}

}  // namespace pietra::deviation
