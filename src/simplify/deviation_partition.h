#pragma once
// Covers one face of a source surface by convex pieces and hands each to a face of a target
// surface, so that the largest distance of a piece to its face is small. The general way: correct
// for any pair of surfaces, and any starting face.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "simplify/deviation_surface.h"

namespace pietra::deviation {

/// A convex polygon of at most eight corners, relative to the lattice point `Partition` was given.
struct Polygon {
    static constexpr int kMaxCorners = 8;
    int count = 0;
    std::array<Vec3f, kMaxCorners> corner;

    void add(const Vec3f& p) { corner[count++] = p; }
    static Polygon of(const LocalTriangle& t) { return {3, {t.a, t.b, t.c}}; }
};

/// Splits by the plane dot(normal, x - point) = 0; the two parts share the points of the cut, so
/// that nothing is lost. Returns false (and leaves the parts undefined) if a part would have too
/// many corners. Parts may be empty (count < 3).
bool splitPolygon(const Polygon& polygon, const Vec3f& point, const Vec3f& normal, Polygon& above,
                  Polygon& below);

/// What rounding may add to a distance between the two.
float distanceSlack(const Polygon& polygon, const LocalTriangle& triangle);

/// The corner that is farthest from the triangle.
int farthestCorner(const Polygon& polygon, const LocalTriangle& triangle);

/// Largest distance of a corner to the triangle, slack for rounding included.
float maxCornerDistance(const Polygon& polygon, const LocalTriangle& triangle);

/// A piece and the face it went to; value = base + offset[target] + distance.
struct Piece {
    Polygon polygon;
    uint32_t source = kNone;
    uint32_t target = kNone;
    float base = 0;
    float value = 0;
    int cuts = 0;  ///< how often it was cut in verification
};

/// One source face at a time, see the head of this file.
class Partition {
public:
    /// `offset`: per target face, added to the distances; empty: zero.
    void setTarget(const Surface& target, std::span<const float> offset) {
        target_ = &target;
        offset_ = offset;
    }

    /// Cuts `polygon` (relative to lattice point `origin`) and appends the pieces to `out`. A piece
    /// whose value is at most `limit` is not cut further.
    void cover(const Polygon& polygon, const Vec3f& origin, uint32_t source, float base,
               uint32_t start, float limit, std::vector<Piece>& out);

    /// base + offset + largest corner distance, rounded up.
    float value(const Polygon& polygon, const Vec3f& origin, float base, uint32_t target) const;

private:
    struct Item {
        Polygon polygon;
        uint32_t face;
        uint32_t from_edge;  ///< the face's edge it came in by, 3 if none
        int steps;
    };
    bool cutAtEdge(Item& item, int edge, const Vec3f& origin);

    const Surface* target_ = nullptr;
    std::span<const float> offset_;
    std::vector<Item> stack_;
};

}  // namespace pietra::deviation
