#pragma once
// Where body 1 expects a new vertex to be, and how its true place is written relative to that.
// Positions are in units of 2^shift, below 2^21, so floats hold them exactly; the rest is float
// with one rounding an operation. Internal to src/store.

#include <array>
#include <cmath>

#include "geometry/vec.h"
#include "store/byte_stream.h"
#include "store/front_walk.h"
#include "store/lanes.h"

namespace pietra {

/// The parallelogram over the gate from item `pivot` to its next, averaged with what the
/// neighbouring edges say where all but two triangles of a sector are covered, so that the new
/// vertex is known to lie between them: the parallelogram over the neighbouring edge, and that of
/// which the sector's vertex is the far corner.
struct Prediction {
    Lanes point;
    Lanes normal;  ///< of the triangle behind the gate, not of unit length

    Prediction(const FrontItems& items, uint32_t pivot) {
        const FrontItem &v = items[pivot], &n = items[v.next];
        const Lanes along = n.at - v.at;
        point = v.over;
        normal = crossProduct(n.at - v.over, along);
        if (v.rest == 2 && n.rest == 2) {
            const FrontItem &p = items[v.prev], &q = items[n.next];
            point = (point + p.over + n.over + (p.at + along) + (q.at - along)) * 0.2f;
        } else if (v.rest == 2) {
            const FrontItem& p = items[v.prev];
            point = (point + p.over + (p.at + along)) * (1.0f / 3);
        } else if (n.rest == 2) {
            point = (point + n.over + (items[n.next].at - along)) * (1.0f / 3);
        }
    }

    /// The axis along which the surface is most nearly a height field.
    int axis() const {
        const float x = std::abs(normal[0]), y = std::abs(normal[1]), z = std::abs(normal[2]);
        if (z >= x && z >= y) return 2;
        return x > y ? 0 : 1;
    }
};

/// Writes a vertex as its difference from the prediction in units of 2^m: along the two axes after
/// the main one, then along that one, whose prediction follows the slope of the surface.
class ResidualCoder {
public:
    explicit ResidualCoder(int m) : unit_(float(1 << m)), magic_(12582912.0f * unit_) {}

    /// Rounded to multiples of 2^m; `position` must be one.
    std::array<uint32_t, 3> encode(const Prediction& prediction, Lanes position) const {
        switch (prediction.axis()) {
            case 0:
                return encodeAlong<1, 2, 0>(prediction, position);
            case 1:
                return encodeAlong<2, 0, 1>(prediction, position);
            default:
                return encodeAlong<0, 1, 2>(prediction, position);
        }
    }

    /// Any codes give some numbers, which may be no place of the lattice, infinite or no numbers.
    Lanes decode(const Prediction& prediction, uint32_t u, uint32_t v, uint32_t w) const {
        const float residual[3] = {scaled(u), scaled(v), scaled(w)};
        switch (prediction.axis()) {
            case 0:
                return decodeAlong<1, 2, 0>(prediction, residual);
            case 1:
                return decodeAlong<2, 0, 1>(prediction, residual);
            default:
                return decodeAlong<0, 1, 2>(prediction, residual);
        }
    }

private:
    float scaled(uint32_t code) const { return float(int32_t(unzigzag(code))) * unit_; }

    /// The multiple of 2^m nearest to x (to even), for |x| < 2^(22+m), plus a multiple of 2^m: the
    /// sum with the magic number, 1.5 * 2^(23+m), has no bits for less.
    float roundAndAdd(float x, float residual) const { return (x + magic_) - (magic_ - residual); }

    template <int U, int V, int W>
    static float risen(const Prediction& p, float at_u, float at_v) {
        const float fall = p.normal[U] * (at_u - p.point[U]) + p.normal[V] * (at_v - p.point[V]);
        return p.normal[W] != 0 ? p.point[W] - fall * (1.0f / p.normal[W]) : p.point[W];
    }

    template <int U, int V, int W>
    std::array<uint32_t, 3> encodeAlong(const Prediction& p, Lanes position) const {
        const auto code = [&](float at, float expected) {
            return zigzag(uint32_t(int32_t((at - roundAndAdd(expected, 0)) / unit_)));
        };
        return {code(position[U], p.point[U]), code(position[V], p.point[V]),
                code(position[W], risen<U, V, W>(p, position[U], position[V]))};
    }

    template <int U, int V, int W>
    Lanes decodeAlong(const Prediction& p, const float* residual) const {
        const float at_u = roundAndAdd(p.point[U], residual[0]);
        const float at_v = roundAndAdd(p.point[V], residual[1]);
        const float at_w = roundAndAdd(risen<U, V, W>(p, at_u, at_v), residual[2]);
        Lanes at{};
        at[U] = at_u;
        at[V] = at_v;
        at[W] = at_w;
        return at;
    }

    float unit_;
    float magic_;
};

}  // namespace pietra
