#include "render/raster/clip.h"

#include <tuple>

namespace pietra {
namespace {

struct Corner {
    Vec3d p;        // view space: right, up, depth
    bool original;  // a vertex of the triangle, exactly representable as float
};

struct Polygon {
    std::array<Corner, kMaxClipped> corner;
    int count = 0;
    /// Rounding may bend a convex polygon so that a plane cuts it more than twice; what does not
    /// fit then has no width.
    void add(const Corner& c) {
        if (count < kMaxClipped) corner[count++] = c;
    }
};

bool before(const Vec3d& a, const Vec3d& b) {
    return std::tie(a.x, a.y, a.z) < std::tie(b.x, b.y, b.z);
}

/// Where an edge meets distance(p) = 0; its ends have distances of unlike sign.
template <class Distance>
Vec3d cut(Vec3d a, Vec3d b, const Distance& distance) {
    if (before(b, a)) std::swap(a, b);
    const double da = distance(a), db = distance(b);
    return a + (b - a) * (da / (da - db));
}

template <class Distance>
Polygon clipBy(const Polygon& in, const Distance& distance) {
    Polygon out;
    for (int i = 0; i < in.count; ++i) {
        const Corner& a = in.corner[i];
        const Corner& b = in.corner[(i + 1) % in.count];
        const bool a_in = distance(a.p) >= 0, b_in = distance(b.p) >= 0;
        if (a_in) out.add(a);
        if (a_in != b_in) out.add({cut(a.p, b.p, distance), false});
    }
    return out;
}

}  // namespace

ScreenPolygon clipTriangle(const Projection& projection, const std::array<Vec3i, 3>& corner) {
    Polygon polygon;
    for (const Vec3i& p : corner) polygon.add({Vec3d(projection.viewPosition(p)), true});
    // A plane through the eye for each side of the guard band, after the near plane: depth is then
    // positive.
    const double slope = kClipFixed / projection.scale;
    polygon = clipBy(polygon, [](const Vec3d& p) { return p.z - double(kNearDepth); });
    polygon = clipBy(polygon, [&](const Vec3d& p) { return slope * p.z - p.x; });
    polygon = clipBy(polygon, [&](const Vec3d& p) { return slope * p.z + p.x; });
    polygon = clipBy(polygon, [&](const Vec3d& p) { return slope * p.z - p.y; });
    polygon = clipBy(polygon, [&](const Vec3d& p) { return slope * p.z + p.y; });

    ScreenPolygon result;
    for (int i = 0; i < polygon.count; ++i) {
        const Corner& c = polygon.corner[i];
        if (c.original) {
            const ScreenVertex image = projection.project(Vec3f(c.p));
            if (image.x != kNoImage) {
                result.point[result.count++] = {image.x, image.y, image.inv_depth};
                continue;
            }
        }
        const double depth = std::max(c.p.z, double(kNearDepth));
        const double scale = projection.scale / depth;
        result.point[result.count++] = {int32_t(std::lrint(projection.centre_x + c.p.x * scale)),
                                        int32_t(std::lrint(projection.centre_y - c.p.y * scale)),
                                        float(projection.inv_step / depth)};
    }
    return result;
}

}  // namespace pietra
