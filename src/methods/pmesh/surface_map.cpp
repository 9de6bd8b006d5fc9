#include "methods/pmesh/surface_map.h"

#include <algorithm>
#include <cmath>

#include "simplify/working_mesh.h"

namespace pietra::pmesh {
namespace {

using Vec2f = glm::vec2;

constexpr uint32_t kV = kMaxNeighbours, kU = kMaxNeighbours + 1, kPlaces = kMaxNeighbours + 2;
constexpr uint32_t kNoPlace = ~0u;
/// What new faces may lose of their areas when they are seen.
constexpr float kSteepest = 1.0f / 16;
/// Of the extent of all that is involved: what rounding may add to a distance, with room.
constexpr float kSlack = 0x1p-19f;

float cross(const Vec2f& a, const Vec2f& b) {
    return a.x * b.y - a.y * b.x;
}

float extentOf(const Vec3f& v) {
    return std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
}

float largestLane(Lanes4 v) {
    return std::max(std::max(v[0], v[1]), std::max(v[2], v[3]));
}

Lanes4 minLanes(Lanes4 a, Lanes4 b) {
    return -maxLanes(-a, -b);
}

/// Four points, by coordinate.
struct Points4 {
    Lanes4 x, y, z;
    static Points4 at(const Vec3f& p, const Vec3f& a, Lanes4 wa, const Vec3f& b, Lanes4 wb) {
        return {p.x + wa * a.x + wb * b.x, p.y + wa * a.y + wb * b.y, p.z + wa * a.z + wb * b.z};
    }
    Lanes4 dot(const Vec3f& v) const { return x * v.x + y * v.y + z * v.z; }
};

Lanes4 squaredDistance(const Points4& a, const Points4& b) {
    const Lanes4 x = a.x - b.x, y = a.y - b.y, z = a.z - b.z;
    return x * x + y * y + z * z;
}

using Edges = std::array<Vec3f, 2>;

/// Products with these are the weights of a point above a triangle.
Edges dualOf(const Edges& edge) {
    const Vec3f normal = glm::cross(edge[0], edge[1]);
    const float squared = glm::dot(normal, normal);
    if (!(squared > 0)) return {Vec3f(0), Vec3f(0)};
    const float scale = 1 / squared;
    return {glm::cross(edge[1], normal) * scale, glm::cross(normal, edge[0]) * scale};
}

/// To a point of the triangle that is near, the nearest one if p is above the triangle.
Lanes4 squaredDistanceTo(const Vec3f& origin, const Edges& edge, const Edges& dual,
                         const Points4& p) {
    const Lanes4 zero{}, one = zero + 1;
    const Points4 d{p.x - origin.x, p.y - origin.y, p.z - origin.z};
    const Lanes4 a = maxLanes(d.dot(dual[0]), zero), b = maxLanes(d.dot(dual[1]), zero);
    const Lanes4 scale = one / maxLanes(a + b, one);
    return squaredDistance(p, Points4::at(origin, edge[0], a * scale, edge[1], b * scale));
}

float distanceTo(const Vec3f& origin, const Edges& edge, const Vec3f& p) {
    const Lanes4 zero{};
    const Lanes4 squared =
        squaredDistanceTo(origin, edge, dualOf(edge), {zero + p.x, zero + p.y, zero + p.z});
    return std::sqrt(squared[0]);
}

}  // namespace

/// The star as it is seen, the merged vertex at 0.
class SurfaceMap::Plane {
public:
    /// False: the new fan is not to be seen all from in front.
    bool layOut(const CollapsingStar& star);
    const Vec2f& at(uint32_t place) const { return flat_[place]; }

private:
    static constexpr int kMostTurns = 4;
    bool layOut(const CollapsingStar& star, const Vec3f& normal);
    void straighten(const CollapsingStar& star);

    std::array<Vec2f, kPlaces> flat_;
};

/// At first from where the new fan looks largest; then turned towards those faces that are seen
/// from behind.
bool SurfaceMap::Plane::layOut(const CollapsingStar& star) {
    Vec3f normal(0);
    std::array<Vec3f, kMaxNeighbours> face_normal;
    for (uint32_t i = 0; i < star.edges(); ++i) {
        face_normal[i] = glm::cross(star.ring[i], star.ring[star.after(i)]);
        normal += face_normal[i];
    }
    for (int turn = 0; turn < kMostTurns; ++turn) {
        const float length = glm::length(normal);
        if (!(length > 0)) return false;
        normal /= length;
        float least = 1;
        Vec3f behind(0);
        for (uint32_t i = 0; i < star.edges(); ++i) {
            const float seen = glm::dot(normal, face_normal[i]);
            const float squared = glm::dot(face_normal[i], face_normal[i]);
            if (seen > 0 && seen * seen > 4 * kSteepest * kSteepest * squared) continue;
            const float cosine = seen / std::sqrt(squared);
            if (!(cosine >= least)) least = cosine, behind = face_normal[i] / std::sqrt(squared);
        }
        if (least == 1) return layOut(star, normal);
        normal += (0.25f - least) * behind;
    }
    return false;
}

bool SurfaceMap::Plane::layOut(const CollapsingStar& star, const Vec3f& normal) {
    const Vec3f other = std::abs(normal.x) < 0.6f ? Vec3f(1, 0, 0) : Vec3f(0, 1, 0);
    const Vec3f x = glm::normalize(glm::cross(other, normal)), y = glm::cross(normal, x);
    const auto flat = [&](const Vec3f& p) { return Vec2f(glm::dot(p, x), glm::dot(p, y)); };
    for (uint32_t i = 0; i < star.size; ++i) flat_[i] = flat(star.ring[i]);
    for (const uint32_t end : {0u, 1u}) flat_[kV + end] = flat(star.end[end]);
    if (!star.closed) straighten(star);
    uint32_t turns = 0;  // of the ring around the merged vertex
    for (uint32_t i = 0; i < star.edges(); ++i) {
        const uint32_t j = star.after(i);
        const Vec3f face_normal = glm::cross(star.ring[i], star.ring[j]);
        const float area = cross(flat_[i], flat_[j]);
        if (!(area > 0 && area * area > kSteepest * kSteepest * glm::dot(face_normal, face_normal)))
            return false;
        turns += flat_[i].y < 0 && flat_[j].y >= 0;
    }
    return turns == uint32_t(star.closed);
}

/// Both borders must be the same line: shears all so that the new one is straight, and drops the
/// ends that lie on the border onto it.
void SurfaceMap::Plane::straighten(const CollapsingStar& star) {
    const Vec2f along = glm::normalize(flat_[0] - flat_[star.size - 1]);
    const auto turned = [&](const Vec2f& p) { return Vec2f(glm::dot(along, p), cross(along, p)); };
    // The border runs from b over 0 to a.
    const Vec2f a = turned(flat_[0]), b = turned(flat_[star.size - 1]);
    const auto sheared = [&](const Vec2f& p) {
        Vec2f q = turned(p);
        if (a.x > 0 && q.x > 0) q.y -= a.y * std::min(q.x / a.x, 1.0f);
        if (b.x < 0 && q.x < 0) q.y -= b.y * std::min(q.x / b.x, 1.0f);
        return q;
    };
    for (uint32_t i = 0; i < star.size; ++i) flat_[i] = sheared(flat_[i]);
    for (const uint32_t end : {0u, 1u}) {
        flat_[kV + end] = sheared(flat_[kV + end]);
        if (star.on_border[end]) flat_[kV + end].y = 0;
    }
}

SurfaceMap::SurfaceMap(const std::vector<float>& bound, const Effort& effort) : effort_(effort) {
    face_.resize(bound.size());
    for (size_t f = 0; f < bound.size(); ++f) {
        face_[f].bound = face_[f].rest = bound[f];
        face_[f].pieces = 0;
    }
}

bool SurfaceMap::collapse(CollapsingStar& star, float stated, float most) {
    extent_ = 0;
    const auto makeRelative = [&](Vec3f& p) {
        p -= star.merged;
        extent_ = std::max(extent_, extentOf(p));
    };
    for (uint32_t i = 0; i < star.size; ++i) makeRelative(star.ring[i]);
    for (Vec3f& end : star.end) makeRelative(end);
    star_ = &star;
    stated_ = stated;
    largest_ = 0;
    overflow_ = false;
    uint32_t count;
    const auto old = oldFaces(count);
    for (uint32_t i = 0; i < star.edges(); ++i) {
        sector_[i].edge = {star.ring[i], star.ring[star.after(i)]};
        sector_[i].dual = dualOf(sector_[i].edge);
        sector_[i].rest = -1;
        sector_[i].made = 0;
    }
    Plane plane;
    plane_ = &plane;
    const bool seen = plane.layOut(star);
    if (seen) {
        for (uint32_t i = 0; i < star.edges(); ++i) setWeights(i);
        for (uint32_t i = 0; i < count; ++i) take(old[i]);
    }
    if (!seen || overflow_) {
        for (uint32_t i = 0; i < star.edges(); ++i) {
            for (uint32_t p = 0; p < sector_[i].made; ++p)
                free_.push_back(sector_[i].piece[p].piece);
            sector_[i].made = 0;
        }
        if (!takeUnseen(std::span(old).first(count), most)) return false;
    }
    for (uint32_t i = 0; i < count; ++i) {
        Face& face = face_[old[i].face];
        for (uint32_t p = 0; p < face.pieces; ++p) free_.push_back(face.piece[p]);
        face.pieces = 0;
    }
    finish();
    return true;
}

void SurfaceMap::setWeights(uint32_t edge) {
    Sector& s = sector_[edge];
    const Vec2f ri = plane_->at(edge), rj = plane_->at(star_->after(edge));
    s.second_is_longer = glm::dot(rj, rj) >= glm::dot(ri, ri);
    const Vec2f longer = s.second_is_longer ? rj : ri;
    s.shorter = s.second_is_longer ? ri : rj;
    s.to_shorter = Vec2f(longer.y, -longer.x) / cross(s.shorter, longer);
    s.to_longer = longer / glm::dot(longer, longer);
}

std::array<SurfaceMap::Old, kMaxNeighbours + 2> SurfaceMap::oldFaces(uint32_t& count) const {
    const CollapsingStar& star = *star_;
    std::array<Old, kMaxNeighbours + 2> old;
    count = 0;
    for (uint32_t i = 0; i < star.edges(); ++i) {
        Old& o = old[count++];
        o.face = star.face[i];
        o.at[star.apex[i]] = star.of_u[i] ? kU : kV;
        o.at[kNextCorner[star.apex[i]]] = i;
        o.at[kPreviousCorner[star.apex[i]]] = star.after(i);
    }
    for (uint32_t w = 0; w < star.wings; ++w) {
        Old& o = old[count++];
        o.face = star.wing[w].face;
        o.at[star.wing[w].corner[0]] = kV;
        o.at[star.wing[w].corner[1]] = kU;
        o.at[star.wing[w].corner[2]] = star.wing[w].ring;
    }
    return old;
}

Vec3f SurfaceMap::placeOf(uint32_t at) const {
    return at < kMaxNeighbours ? star_->ring[at] : star_->end[at - kV];
}

/// Cuts an old face, or its pieces.
void SurfaceMap::take(const Old& old) {
    const Face& face = face_[old.face];
    const Vec2f a = plane_->at(old.at[0]), b = plane_->at(old.at[1]) - a,
                c = plane_->at(old.at[2]) - a;
    const Lanes4 to_a{0, 0, a.x, a.y}, to_b{0, 0, b.x, b.y}, to_c{0, 0, c.x, c.y};
    const Lanes4 same{1, 1, 0, 0};
    Polygon polygon;
    for (uint32_t p = 0; p < face.pieces; ++p) {
        const Piece& piece = pieceAt(face.piece[p]);
        polygon.size = piece.size;
        for (uint32_t k = 0; k < piece.size; ++k) {
            const Lanes4& w = piece.corner[k];
            polygon.corner[k] = same * w + to_a + broadcast<2>(w) * to_b + broadcast<3>(w) * to_c;
        }
        from_ = piece.source;
        from_.origin -= star_->merged;
        cut(polygon);
    }
    if (face.rest < 0) return;
    const Vec3f origin = placeOf(old.at[0]);
    from_ = {
        origin, {placeOf(old.at[1]) - origin, placeOf(old.at[2]) - origin}, face.bound, face.rest};
    polygon.size = 3;
    polygon.corner[0] = to_a;
    polygon.corner[1] = to_a + to_b + Lanes4{1, 0, 0, 0};
    polygon.corner[2] = to_a + to_c + Lanes4{0, 1, 0, 0};
    cut(polygon);
}

/// Hands a polygon out to the new faces that it is seen in.
void SurfaceMap::cut(const Polygon& polygon) {
    const uint32_t edges = star_->edges();
    has_dual_ = false;
    slack_ = kSlack *
             (extent_ + extentOf(from_.origin) + extentOf(from_.edge[0]) + extentOf(from_.edge[1]));
    // Bits: the corners on the sides of the lines through the new edges.
    std::array<uint32_t, kMaxNeighbours> left, right;
    std::array<Lanes4, 4> column;
    left.fill(0);
    right.fill(0);
    for (uint32_t k = 0; k < polygon.size; k += 4) {
        for (uint32_t n = 0; n < 4; ++n)
            column[n] = polygon.corner[k + n < polygon.size ? k + n : 0];
        transpose(column[0], column[1], column[2], column[3]);
        const Lanes4 zero{};
        for (uint32_t i = 0; i < star_->size; ++i) {
            const Vec2f& r = plane_->at(i);
            const Lanes4 side = r.x * column[3] - r.y * column[2];
            left[i] |= signBits(Lanes4(side > zero));
            right[i] |= signBits(Lanes4(side < zero));
        }
    }
    // A ray that all of it is left of, the last before one that it is not.
    uint32_t first = kNoPlace;
    for (uint32_t i = 0; i < edges; ++i) {
        if (right[i]) continue;
        const uint32_t j = star_->after(i);
        if (!left[j]) return give(i, polygon);
        if (right[j] || i + 1 == star_->size - 1) first = i;
    }
    if (first != kNoPlace) return sweep(polygon, plane_->at(first), first);
    const Vec2f ray = plane_->at(0);
    Polygon half[2];
    split(polygon, ray, half[0], half[1]);
    sweep(half[0], ray, 0);
    while (first + 2 < edges && cross(ray, plane_->at(first + 2)) > 0) ++first;
    sweep(half[1], -ray, star_->closed ? first + 1 : 0);
}

/// What is left of the line from 0 to `ray`, and what is right of it. Both have the same corners on
/// it, so that nothing is lost.
void SurfaceMap::split(const Polygon& polygon, const Vec2f& ray, Polygon& left, Polygon& right) {
    const auto sideOf = [&](const Lanes4& c) { return ray.x * c[3] - ray.y * c[2]; };
    float side = sideOf(polygon.corner[0]);
    for (uint32_t k = 0; k < polygon.size; ++k) {
        const Lanes4& corner = polygon.corner[k];
        const Lanes4& next = polygon.corner[k + 1 == polygon.size ? 0 : k + 1];
        const float next_side = sideOf(next);
        if (side >= 0) left.add(corner);
        if (side <= 0) right.add(corner);
        if ((side > 0 && next_side < 0) || (side < 0 && next_side > 0)) {
            const Lanes4 between = corner + (side / (side - next_side)) * (next - corner);
            left.add(between);
            right.add(between);
        }
        side = next_side;
    }
}

/// Hands out what lies left of `base`, from this sector on.
void SurfaceMap::sweep(const Polygon& polygon, const Vec2f& base, uint32_t sector) {
    Polygon buffer[2];
    const Polygon* rest = &polygon;
    while (rest->size >= 3) {
        if (rest->size > kMostCut) return void(overflow_ = true);
        const uint32_t next = star_->after(sector);
        const bool is_last =
            star_->closed ? cross(base, plane_->at(next)) <= 0 : sector + 1 == star_->edges();
        if (is_last) return give(sector, *rest);
        Polygon &left = buffer[rest == &buffer[0]], right;
        left.size = 0;
        split(*rest, plane_->at(next), left, right);
        give(sector, right);
        rest = &left;
        sector = next;
    }
}

void SurfaceMap::give(uint32_t edge, const Polygon& part) {
    if (part.size < 3) return;
    if (part.size > kMostCut) return void(overflow_ = true);
    const Sector& sector = sector_[edge];
    std::array<Lanes4, 4> weights[kMostCut / 4];  // as a piece has them, by columns
    Points4 from[kMostCut / 4], to[kMostCut / 4];
    Lanes4 largest_sq{};
    for (uint32_t k = 0; k < part.size; k += 4) {
        auto& [s, t, wi, wj] = weights[k / 4];
        s = part.corner[k];
        t = part.corner[k + 1 < part.size ? k + 1 : 0];
        Lanes4 x = part.corner[k + 2 < part.size ? k + 2 : 0];
        Lanes4 y = part.corner[k + 3 < part.size ? k + 3 : 0];
        transpose(s, t, x, y);
        const Lanes4 shorter = x * sector.to_shorter.x + y * sector.to_shorter.y;
        x -= shorter * sector.shorter.x;
        y -= shorter * sector.shorter.y;
        const Lanes4 longer = x * sector.to_longer.x + y * sector.to_longer.y;
        wi = sector.second_is_longer ? shorter : longer;
        wj = sector.second_is_longer ? longer : shorter;
        from[k / 4] = Points4::at(from_.origin, from_.edge[0], s, from_.edge[1], t);
        to[k / 4] = Points4::at(Vec3f(0), sector.edge[0], wi, sector.edge[1], wj);
        largest_sq = maxLanes(largest_sq, squaredDistance(from[k / 4], to[k / 4]));
    }
    const float limit = this->limit();
    float bound = from_.rest + std::sqrt(largestLane(largest_sq)) + slack_;
    if (!(bound <= limit)) {
        if (!has_dual_) from_dual_ = dualOf(from_.edge);
        has_dual_ = true;
        Lanes4 to_new{}, to_old{};
        for (uint32_t k = 0; k < part.size; k += 4) {
            const Points4 &p = from[k / 4], &q = to[k / 4];
            const Lanes4 moved = squaredDistance(p, q);
            to_new = maxLanes(
                to_new, minLanes(moved, squaredDistanceTo(Vec3f(0), sector.edge, sector.dual, p)));
            to_old = maxLanes(to_old, squaredDistanceTo(from_.origin, from_.edge, from_dual_, q));
        }
        const float forth = from_.rest + std::sqrt(largestLane(to_new));
        const float back = from_.bound + std::sqrt(largestLane(to_old));
        bound = std::min(bound, std::max(forth, back) + slack_);
    }
    bound *= 1 + 0x1p-20f;
    largest_ = std::max(largest_, bound);
    if (bound <= limit || effort_.matters >= 1) {
        sector_[edge].rest = std::max(sector_[edge].rest, bound);
        return;
    }
    Polygon placed;
    placed.size = part.size;
    const uint32_t apex = star_->apex[edge];
    for (uint32_t k = 0; k < part.size; k += 4) {
        auto& [a, b, c, d] = weights[k / 4];
        const Lanes4 at_apex = 1 - c - d;
        if (apex == 1) d = c, c = at_apex;
        if (apex == 2) c = d, d = at_apex;
        transpose(a, b, c, d);
        std::copy_n(weights[k / 4].data(), 4, &placed.corner[k]);
    }
    keep(edge, placed, bound);
}

void SurfaceMap::keep(uint32_t edge, const Polygon& part, float bound) {
    if (part.size > kMostCorners) {
        const uint32_t middle = part.size / 2;
        Polygon half[2];
        for (uint32_t k = 0; k <= middle; ++k) half[0].add(part.corner[k]);
        for (uint32_t k = middle; k < part.size; ++k) half[1].add(part.corner[k]);
        half[1].add(part.corner[0]);
        keep(edge, half[0], bound);
        return keep(edge, half[1], bound);
    }
    Sector& sector = sector_[edge];
    if (sector.made == effort_.kept) {
        const float least = sector.piece[0].bound;
        sector.rest = std::max(sector.rest, std::min(bound, least));
        if (bound <= least) return;
    }
    const uint32_t at = placeAmong(edge, bound);
    Piece& piece = pieceAt(at);
    piece.source = from_;
    piece.source.origin += star_->merged;
    piece.size = part.size;
    std::copy_n(part.corner.data(), part.size, piece.corner.data());
}

/// A piece for a sector's, of which it takes the place of the first one where they are all.
uint32_t SurfaceMap::placeAmong(uint32_t edge, float bound) {
    Sector& sector = sector_[edge];
    uint32_t at, i;
    if (sector.made == effort_.kept) {
        at = sector.piece[0].piece;
        for (i = 0; i + 1 < sector.made && sector.piece[i + 1].bound < bound; ++i)
            sector.piece[i] = sector.piece[i + 1];
    } else {
        if (free_.empty()) {
            const auto first = uint32_t(chunk_.size()) * kChunk;
            chunk_.push_back(std::make_unique<std::array<Piece, kChunk>>());
            for (uint32_t n = kChunk; n > 0; --n) free_.push_back(first + n - 1);
        }
        at = free_.back();
        free_.pop_back();
        for (i = sector.made++; i > 0 && sector.piece[i - 1].bound >= bound; --i)
            sector.piece[i] = sector.piece[i - 1];
    }
    sector.piece[i] = {at, bound};
    return at;
}

/// Keeps the pieces that matter.
void SurfaceMap::finish() {
    const float limit = this->limit();
    for (uint32_t i = 0; i < star_->edges(); ++i) {
        Sector& sector = sector_[i];
        Face& face = face_[star_->face[i]];
        face.pieces = 0;
        face.bound = face.rest = sector.rest;
        for (uint32_t p = sector.made; p-- > 0;) {
            const Made& made = sector.piece[p];
            face.bound = std::max(face.bound, made.bound);
            if (made.bound > limit) {
                face.piece[face.pieces++] = made.piece;
            } else {
                face.rest = std::max(face.rest, made.bound);
                free_.push_back(made.piece);
            }
        }
        // So thin that nothing was seen in it: as its neighbours.
        if (face.rest < 0 && face.pieces == 0) face.rest = face.bound = largest_;
    }
}

/// Old faces and new ones as wholes, each to the one that it is nearest to.
bool SurfaceMap::takeUnseen(std::span<const Old> old, float most) {
    const CollapsingStar& star = *star_;
    std::array<float, kMaxNeighbours> bound;
    bound.fill(0);
    largest_ = 0;
    for (uint32_t i = 0; i < star.edges(); ++i) sector_[i].rest = HUGE_VALF;
    for (const Old& o : old) {
        const Vec3f origin = placeOf(o.at[0]);
        const Edges edge{placeOf(o.at[1]) - origin, placeOf(o.at[2]) - origin};
        uint32_t nearest = 0;
        float least = HUGE_VALF;
        for (uint32_t i = 0; i < star.edges(); ++i) {
            float forth = 0, back = distanceTo(origin, edge, Vec3f(0));
            for (const uint32_t at : o.at)
                forth = std::max(forth, distanceTo(Vec3f(0), sector_[i].edge, placeOf(at)));
            for (const uint32_t at : {i, star.after(i)})
                back = std::max(back, distanceTo(origin, edge, star.ring[at]));
            if (forth < least) least = forth, nearest = i;
            sector_[i].rest = std::min(sector_[i].rest, face_[o.face].bound + back);
        }
        bound[nearest] = std::max(bound[nearest], face_[o.face].bound + least);
    }
    for (uint32_t i = 0; i < star.edges(); ++i) {
        sector_[i].rest =
            std::max(sector_[i].rest, bound[i]) * (1 + 0x1p-20f) + 4 * kSlack * extent_;
        largest_ = std::max(largest_, sector_[i].rest);
    }
    return largest_ <= most;
}

}  // namespace pietra::pmesh
