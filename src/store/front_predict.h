#pragma once
// Where body 1 expects a new vertex to be, and how its true place is written relative to that. The
// arithmetic is exact, or double with one rounding an operation, so every machine agrees. Positions
// are in units of 2^shift, below 2^21. Internal to src/store.

#include <cmath>
#include <span>

#include "geometry/vec.h"
#include "store/byte_stream.h"
#include "store/front_walk.h"

namespace pietra {

struct Prediction {
    Vec3i point;
    int axis;     ///< along which the surface is most nearly a height field
    Vec3d slope;  ///< change of that coordinate for a step along each of the others; 0 along itself
};

/// The parallelogram over the gate, averaged with those over the neighbouring edges where all but
/// one triangle of a sector is covered, so that the new vertex is known to lie there too.
inline Prediction predictVertex(std::span<const FrontItem> items, std::span<const Vec3i> position,
                                uint32_t pivot) {
    const FrontItem &v = items[pivot], &n = items[v.next], &p = items[v.prev];
    const Vec3i at_v = position[v.vertex], at_n = position[n.vertex];
    // Without a triangle behind the gate: mirror the edge before it.
    const Vec3i at_o = v.behind == kNone ? at_v + at_v - position[p.vertex] : position[v.behind];
    const Vec3i gate = at_v + at_n - at_o;
    Vec3i extra(0);
    int others = 0;
    if (v.rest == 2 && p.behind != kNone) {
        extra += at_v + position[p.vertex] - position[p.behind] - gate;
        ++others;
    }
    if (n.rest == 2 && n.behind != kNone) {
        extra += at_n + position[items[n.next].vertex] - position[n.behind] - gate;
        ++others;
    }
    Prediction result{gate, 2, {0, 0, 0}};
    if (others == 1)
        result.point += extra / 3;
    else if (others == 2)
        result.point += extra / 4;
    const Vec3d along(at_n - at_v), across(at_o - at_v);
    const Vec3d normal = glm::cross(across, along);
    const Vec3d size = glm::abs(normal);
    result.axis = size.x > size.y ? (size.x > size.z ? 0 : 2) : (size.y > size.z ? 1 : 2);
    const double height = normal[result.axis];
    if (height != 0) {
        const double inverse = -1.0 / height;
        result.slope = normal * inverse;
        result.slope[result.axis] = 0;
    }
    return result;
}

/// The coordinate of a multiple of 2^m nearest to x, in units of 2^m.
inline int32_t toCoarse(int32_t x, int m) {
    return (x + ((1 << m) >> 1)) >> m;
}

/// Residuals in units of 2^m, in the order: the two axes after `axis`, then `axis` itself, whose
/// prediction follows the surface's slope.
struct Residual {
    uint32_t code[3];  ///< zigzag
};

inline Residual residualOf(const Prediction& prediction, const Vec3i& position, int m) {
    const int u = prediction.axis == 2 ? 0 : prediction.axis + 1;
    const int w = u == 2 ? 0 : u + 1;
    const auto code = [&](int a, int32_t predicted) {
        return zigzag(uint32_t((position[a] >> m) - toCoarse(predicted, m)));
    };
    const double lift = prediction.slope[u] * double(position[u] - prediction.point[u]) +
                        prediction.slope[w] * double(position[w] - prediction.point[w]);
    const int32_t risen = prediction.point[prediction.axis] + int32_t(std::floor(lift + 0.5));
    return {
        {code(u, prediction.point[u]), code(w, prediction.point[w]), code(prediction.axis, risen)}};
}

}  // namespace pietra
