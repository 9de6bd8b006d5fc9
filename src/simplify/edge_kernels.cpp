#include "simplify/edge_kernels.h"

#include <cmath>
#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simplify/edge_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using PlaceTag = HWY_CAPPED(float, 16);
using FoldTag = HWY_CAPPED(float, 8);
static_assert(kBatch % 16 == 0 && kFoldBatch == 8);

template <class V>
struct V3 {
    V x, y, z;
};
template <class V>
HWY_INLINE V3<V> operator+(const V3<V>& a, const V3<V>& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
template <class V>
HWY_INLINE V3<V> operator-(const V3<V>& a, const V3<V>& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
template <class V>
HWY_INLINE V3<V> scaled(const V3<V>& a, const V& s) {
    return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}
template <class V>
HWY_INLINE V dot(const V3<V>& a, const V3<V>& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
template <class V>
HWY_INLINE V3<V> cross(const V3<V>& a, const V3<V>& b) {
    return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
            hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
            hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
template <class M, class V>
HWY_INLINE V3<V> select(M mask, const V3<V>& yes, const V3<V>& no) {
    return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
            hn::IfThenElse(mask, yes.z, no.z)};
}

/// Four floats of each lane's record.
template <class V>
struct Columns {
    V c0, c1, c2, c3;
    HWY_INLINE V3<V> xyz() const { return {c0, c1, c2}; }
};

static_assert(offsetof(Quadric, a02) == 16 && offsetof(Quadric, b0) == 32);

#if HWY_TARGET == HWY_SCALAR

using Row = Columns<hn::Vec<PlaceTag>>;

HWY_INLINE Row loadRow(const float* f) {
    const PlaceTag d;
    return {hn::Load(d, f), hn::Load(d, f + 1), hn::Load(d, f + 2), hn::Load(d, f + 3)};
}

HWY_INLINE Row addRows(const Row& a, const Row& b) {
    return {hn::Add(a.c0, b.c0), hn::Add(a.c1, b.c1), hn::Add(a.c2, b.c2), hn::Add(a.c3, b.c3)};
}

template <class D, class Load>
HWY_INLINE Row gather(D, const Load& load) {
    return load(0);
}

#else

using RowTag = HWY_CAPPED(float, 4);
using Row = hn::Vec<RowTag>;

HWY_INLINE Row loadRow(const float* f) {
    return hn::Load(RowTag(), f);
}

HWY_INLINE Row addRows(const Row& a, const Row& b) {
    return hn::Add(a, b);
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE Columns<V> transpose(D d, V r0, V r1, V r2, V r3) {
    const V t0 = hn::InterleaveLower(d, r0, r2), t1 = hn::InterleaveLower(d, r1, r3);
    const V t2 = hn::InterleaveUpper(d, r0, r2), t3 = hn::InterleaveUpper(d, r1, r3);
    return {hn::InterleaveLower(d, t0, t1), hn::InterleaveUpper(d, t0, t1),
            hn::InterleaveLower(d, t2, t3), hn::InterleaveUpper(d, t2, t3)};
}

/// One row of each 128-bit block: lanes i, i + 4, ...
template <class Load>
HWY_INLINE Row rowsOf(RowTag, const Load& load, size_t i) {
    return load(i);
}
template <class D, class Load>
HWY_INLINE hn::Vec<D> rowsOf(D d, const Load& load, size_t i) {
    const hn::Half<D> half;
    return hn::Combine(d, rowsOf(half, load, i + hn::MaxLanes(half)), rowsOf(half, load, i));
}

/// load(i): the four floats of lane i's record.
template <class D, class Load>
HWY_INLINE Columns<hn::Vec<D>> gather(D d, const Load& load) {
    return transpose(d, rowsOf(d, load, 0), rowsOf(d, load, 1), rowsOf(d, load, 2),
                     rowsOf(d, load, 3));
}

#endif

constexpr size_t kPointFloats = sizeof(Point) / 4, kQuadricFloats = sizeof(Quadric) / 4;

/// Four floats of each lane's record: at base + id * stride. note: no lambdas; g++ 12 does not
/// inline all of them.
struct RowOf {
    const float* base;
    size_t stride;
    const uint32_t* ids;
    HWY_INLINE Row operator()(size_t i) const { return loadRow(base + ids[i] * stride); }
};

HWY_INLINE RowOf rowOf(const Point* points, const uint32_t* ids) {
    return {&points->x, kPointFloats, ids};
}
HWY_INLINE RowOf rowOf(const Quadric* quadrics, const uint32_t* ids, size_t row) {
    return {&quadrics->a00 + 4 * row, kQuadricFloats, ids};
}

/// The sum of rows of two quadrics.
struct RowOfBoth {
    const Quadric* quadrics;
    const uint32_t *u, *v;
    size_t row;
    HWY_INLINE Row operator()(size_t i) const {
        return addRows(rowOf(quadrics, u, row)(i), rowOf(quadrics, v, row)(i));
    }
};

template <class D>
HWY_INLINE V3<hn::Vec<D>> positionsOf(D d, const Point* points, const uint32_t* ids) {
    return gather(d, rowOf(points, ids)).xyz();
}

template <class V>
struct Symmetric {
    V a00, a11, a22, a01, a02, a12;

    HWY_INLINE V3<V> times(const V3<V>& z) const {
        return {dot({a00, a01, a02}, z), dot({a01, a11, a12}, z), dot({a02, a12, a22}, z)};
    }

    /// Subtracts a b', which is symmetric.
    HWY_INLINE void subtractProduct(const V3<V>& a, const V3<V>& b) {
        a00 = hn::Sub(a00, hn::Mul(a.x, b.x));
        a11 = hn::Sub(a11, hn::Mul(a.y, b.y));
        a22 = hn::Sub(a22, hn::Mul(a.z, b.z));
        a01 = hn::Sub(a01, hn::Mul(a.x, b.y));
        a02 = hn::Sub(a02, hn::Mul(a.x, b.z));
        a12 = hn::Sub(a12, hn::Mul(a.y, b.z));
    }

    /// Solves A z = -g by LDL'.
    template <class D>
    HWY_INLINE V3<V> solveNegative(D d, const V3<V>& g) const {
        const V one = hn::Set(d, 1.0f);
        const V r0 = hn::Div(one, a00);
        const V l10 = hn::Mul(a01, r0), l20 = hn::Mul(a02, r0);
        const V d1 = hn::Sub(a11, hn::Mul(l10, a01));
        const V t21 = hn::Sub(a12, hn::Mul(l20, a01));
        const V r1 = hn::Div(one, d1);
        const V l21 = hn::Mul(t21, r1);
        const V d2 = hn::Sub(hn::Sub(a22, hn::Mul(l20, a02)), hn::Mul(l21, t21));
        const V y0 = hn::Neg(g.x);
        const V y1 = hn::Sub(hn::Neg(g.y), hn::Mul(l10, y0));
        const V y2 = hn::Sub(hn::Sub(hn::Neg(g.z), hn::Mul(l20, y0)), hn::Mul(l21, y1));
        const V z2 = hn::Div(y2, d2);
        const V z1 = hn::Sub(hn::Mul(y1, r1), hn::Mul(l21, z2));
        const V z0 = hn::Sub(hn::Sub(hn::Mul(y0, r0), hn::Mul(l10, z1)), hn::Mul(l20, z2));
        return {z0, z1, z2};
    }
};

template <class D, class V = hn::Vec<D>>
HWY_INLINE V snap(D d, V p, const SnapGrid& grid, float low, float high) {
    const V scaled = hn::Add(hn::Mul(p, hn::Set(d, grid.inverse_step)), hn::Set(d, 0.5f));
    const V snapped = hn::Mul(hn::Floor(scaled), hn::Set(d, grid.step));
    // note: adding zero turns -0 into 0, so that equal positions have equal bytes.
    return hn::Add(hn::Max(hn::Set(d, low), hn::Min(hn::Set(d, high), snapped)), hn::Zero(d));
}

/// The sum of both vertices' quadrics around u: f(z) = z'Az + 2 g'z + c.
template <class V>
struct EdgeQuadric {
    Symmetric<V> a;
    V3<V> g;
    V c;
    V weight, weight_v;
    V3<V> back;  // from v to u

    HWY_INLINE V valueAt(const V3<V>& z) const { return hn::Add(dot(a.times(z) + g + g, z), c); }
};

/// What the attributes' best values depend on: value = value of u + (D + G.z) / weight, see
/// attributes.h.
template <class V>
struct EdgeAttribute {
    V3<V> gradient;  // G
    V offset;        // D
    V value_u;
    V rise;  // from u to v
};

/// Takes the attributes, at their best values, out of the quadric.
template <class D, class V>
HWY_INLINE void reduceAttribute(D d, const Columns<V>& of_u, const Columns<V>& of_v,
                                EdgeQuadric<V>& q, EdgeAttribute<V>& attribute) {
    const V step = hn::Neg(attribute.rise);
    const V moved = hn::Add(of_v.c3, dot(of_v.xyz(), q.back));
    const V weighted = hn::Mul(q.weight_v, step);
    q.c = hn::Add(q.c, hn::Mul(step, hn::Sub(weighted, hn::Add(moved, moved))));
    q.g = q.g - scaled(of_v.xyz(), step);
    attribute.gradient = of_u.xyz() + of_v.xyz();
    attribute.offset = hn::Sub(hn::Add(of_u.c3, moved), weighted);
    const V inverse = hn::Div(hn::Set(d, 1.0f), q.weight);
    const V3<V> mean = scaled(attribute.gradient, inverse);
    q.a.subtractProduct(mean, attribute.gradient);
    q.g = q.g - scaled(mean, attribute.offset);
    q.c = hn::Sub(q.c, hn::Mul(hn::Mul(attribute.offset, attribute.offset), inverse));
}

template <class D, class V>
HWY_INLINE void reduceAttributes(D d, const AttributeView& view, const uint32_t* u,
                                 const uint32_t* v, EdgeQuadric<V>& q,
                                 EdgeAttribute<V>* attributes) {
    for (uint32_t j = 0; j < view.count; ++j) {
        if (j % 4 == 0) {
            const auto values_u = gather(d, RowOf{view.value + j, view.value_stride, u});
            const auto values_v = gather(d, RowOf{view.value + j, view.value_stride, v});
            const V of_u[4] = {values_u.c0, values_u.c1, values_u.c2, values_u.c3};
            const V of_v[4] = {values_v.c0, values_v.c1, values_v.c2, values_v.c3};
            for (uint32_t k = 0; k < 4 && j + k < view.count; ++k) {
                attributes[j + k].value_u = of_u[k];
                attributes[j + k].rise = hn::Sub(of_v[k], of_u[k]);
            }
        }
        const float* rows = &view.row->gx + 4 * j;
        reduceAttribute(d, gather(d, RowOf{rows, 4 * size_t(view.count), u}),
                        gather(d, RowOf{rows, 4 * size_t(view.count), v}), q, attributes[j]);
    }
}

/// The value at z, within those of both ends; returns what it costs not to take the best one.
template <class D, class M, class V>
HWY_INLINE V attributeAt(D d, const EdgeQuadric<V>& q, const EdgeAttribute<V>& attribute,
                         const V3<V>& z, M at_u, M at_v, float* value) {
    const V best = hn::Div(hn::Add(attribute.offset, dot(attribute.gradient, z)), q.weight);
    const V zero = hn::Zero(d), rise = attribute.rise;
    V t = hn::Max(hn::Min(zero, rise), hn::Min(hn::Max(zero, rise), best));
    t = hn::IfThenElse(at_u, zero, hn::IfThenElse(at_v, rise, t));
    hn::Store(hn::Add(attribute.value_u, t), d, value);
    const V off = hn::Sub(t, best);
    return hn::Mul(q.weight, hn::Mul(off, off));
}

template <class D, class V = hn::Vec<D>>
HWY_INLINE EdgeQuadric<V> sumQuadrics(D d, const Quadric* quadrics, const uint32_t* u,
                                      const uint32_t* v, const V3<V>& back) {
    const Columns<V> v0 = gather(d, rowOf(quadrics, v, 0));
    const Columns<V> v1 = gather(d, rowOf(quadrics, v, 1));
    const Columns<V> v2 = gather(d, rowOf(quadrics, v, 2));
    const Columns<V> s0 = gather(d, RowOfBoth{quadrics, u, v, 0});
    const Columns<V> s1 = gather(d, RowOfBoth{quadrics, u, v, 1});
    const Columns<V> s2 = gather(d, RowOfBoth{quadrics, u, v, 2});
    const Symmetric<V> of_v{v0.c0, v0.c1, v0.c2, v0.c3, v1.c0, v1.c1};
    const V3<V> moved = of_v.times(back), b = v2.xyz();
    return {{s0.c0, s0.c1, s0.c2, s0.c3, s1.c0, s1.c1},
            s2.xyz() + moved,
            hn::Add(s1.c2, dot(moved + b + b, back)),
            hn::Max(s1.c3, hn::Set(d, 1e-30f)),
            v1.c3,
            back};
}

template <bool kAttributes>
HWY_INLINE void placeLanes(const Point* points, const Quadric* quadrics, const AttributeView& view,
                           const SnapGrid& grid, EdgeBatch& batch, size_t first) {
    using V = hn::Vec<PlaceTag>;
    const PlaceTag d;
    const hn::RebindToSigned<PlaceTag> di;
    const uint32_t *u = batch.u + first, *v = batch.v + first;
    const Columns<V> of_u = gather(d, rowOf(points, u)), of_v = gather(d, rowOf(points, v));
    const V3<V> at_u = of_u.xyz(), at_v = of_v.xyz(), edge = at_v - at_u;
    EdgeQuadric<V> q = sumQuadrics(d, quadrics, u, v, at_u - at_v);
    EdgeAttribute<V> attributes[kAttributes ? kMaxQuadricAttributes : 1];
    if constexpr (kAttributes) reduceAttributes(d, view, u, v, q, attributes);

    const V3<V> optimum = q.a.solveNegative(d, q.g);
    const V3<V> middle = scaled(edge, hn::Set(d, 0.5f));
    const V3<V> off = optimum - middle;
    const auto near = hn::Le(dot(off, off), dot(edge, edge));
    const V3<V> place = at_u + select(near, optimum, middle);
    const V3<V> snapped{snap(d, place.x, grid, grid.low.x, grid.high.x),
                        snap(d, place.y, grid, grid.low.y, grid.high.y),
                        snap(d, place.z, grid, grid.low.z, grid.high.z)};

    // A curve keeps vertices of its own: the end with the lower cost, v where f(edge) < f(0).
    const auto rank_mask = hn::Set(di, int32_t(kRankMask)),
               curve = hn::Set(di, int32_t(kRankCurve));
    const auto rank_u = hn::And(hn::BitCast(di, of_u.c3), rank_mask);
    const auto rank_v = hn::And(hn::BitCast(di, of_v.c3), rank_mask);
    const auto on_curve = hn::RebindMask(d, hn::And(hn::Eq(rank_u, curve), hn::Eq(rank_v, curve)));
    const auto v_is_better = hn::Lt(dot(q.a.times(edge) + q.g + q.g, edge), hn::Zero(d));
    const auto to_u =
        hn::Or(hn::RebindMask(d, hn::Gt(rank_u, rank_v)), hn::AndNot(v_is_better, on_curve));
    const auto to_v =
        hn::Or(hn::RebindMask(d, hn::Gt(rank_v, rank_u)), hn::And(v_is_better, on_curve));
    const V3<V> to = select(to_u, at_u, select(to_v, at_v, snapped));

    const V3<V> z = to - at_u;
    V cost = q.valueAt(z);
    if constexpr (kAttributes)
        for (uint32_t j = 0; j < view.count; ++j)
            cost = hn::Add(cost,
                           attributeAt(d, q, attributes[j], z, to_u, to_v, batch.value[j] + first));
    hn::Store(hn::Max(cost, hn::Zero(d)), d, batch.cost + first);
    hn::Store(to.x, d, batch.x + first);
    hn::Store(to.y, d, batch.y + first);
    hn::Store(to.z, d, batch.z + first);
}

void place(const Point* points, const Quadric* quadrics, const AttributeView& attributes,
           const SnapGrid& grid, EdgeBatch& batch) {
    for (size_t i = 0; i < kBatch; i += hn::MaxLanes(PlaceTag())) {
        if (attributes.count == 0)
            placeLanes<false>(points, quadrics, attributes, grid, batch, i);
        else
            placeLanes<true>(points, quadrics, attributes, grid, batch, i);
    }
}

HWY_INLINE uint32_t foldingLanes(const Point* points, const uint32_t* apex, const uint32_t* next,
                                 const uint32_t* previous, const V3<hn::Vec<FoldTag>>& to) {
    using V = hn::Vec<FoldTag>;
    const FoldTag d;
    const V3<V> from = positionsOf(d, points, apex);
    const V3<V> n = positionsOf(d, points, next), p = positionsOf(d, points, previous);
    const V3<V> new_n = n - to, new_p = p - to, opposite = n - p;
    const V3<V> old_normal = cross(n - from, p - from), new_normal = cross(new_n, new_p);
    const V new_sq = dot(new_normal, new_normal);
    const V longest =
        hn::Max(hn::Max(dot(new_n, new_n), dot(new_p, new_p)), dot(opposite, opposite));
    const auto shapely = hn::Gt(new_sq, hn::Mul(hn::Set(d, kMinShape), hn::Mul(longest, longest)));
    const V turn = dot(old_normal, new_normal);
    // note: squares of squared areas would overflow near the root, hence the quotient.
    const V turn_sq = hn::Mul(turn, hn::Div(turn, dot(old_normal, old_normal)));
    const auto straight = hn::And(hn::Gt(turn, hn::Zero(d)),
                                  hn::Gt(turn_sq, hn::Mul(hn::Set(d, kMinCosineSq), new_sq)));
    uint8_t bits[8] = {0};
    hn::StoreMaskBits(d, hn::Not(hn::And(shapely, straight)), bits);
    return uint32_t(bits[0]) & ((1u << hn::MaxLanes(d)) - 1);
}

uint32_t foldingTriangles(const Point* points, const uint32_t* apex, const uint32_t* next,
                          const uint32_t* previous, const Vec3f& to) {
    const FoldTag d;
    const V3<hn::Vec<FoldTag>> at{hn::Set(d, to.x), hn::Set(d, to.y), hn::Set(d, to.z)};
    uint32_t bits = 0;
    for (size_t i = 0; i < kFoldBatch; i += hn::MaxLanes(d))
        bits |= foldingLanes(points, apex + i, next + i, previous + i, at) << i;
    return bits;
}

/// The squared distance of the point `from` + w to the segment from `from` along `edge`.
template <class D, class V>
HWY_INLINE V segmentDistanceSq(D d, const V3<V>& w, const V3<V>& edge) {
    const V tiny = hn::Set(d, 1e-30f), zero = hn::Zero(d), one = hn::Set(d, 1.0f);
    const V t = hn::Div(dot(w, edge), hn::Max(dot(edge, edge), tiny));
    const V3<V> off = w - scaled(edge, hn::Max(zero, hn::Min(one, t)));
    return dot(off, off);
}

float fanDistanceSq(const Point* points, const uint32_t* next, const uint32_t* previous,
                    const Vec3f& apex, const Vec3f& point) {
    using V = hn::Vec<FoldTag>;
    const FoldTag d;
    const V3<V> a{hn::Set(d, apex.x), hn::Set(d, apex.y), hn::Set(d, apex.z)};
    const V3<V> w{hn::Set(d, point.x - apex.x), hn::Set(d, point.y - apex.y),
                  hn::Set(d, point.z - apex.z)};
    const V zero = hn::Zero(d);
    V least = hn::Set(d, HUGE_VALF);
    for (size_t i = 0; i < kFoldBatch; i += hn::MaxLanes(d)) {
        const V3<V> ab = positionsOf(d, points, next + i) - a;
        const V3<V> ac = positionsOf(d, points, previous + i) - a;
        const V3<V> normal = cross(ab, ac);
        const V normal_sq = dot(normal, normal), height = dot(w, normal);
        const V s = dot(cross(w, ac), normal), t = dot(cross(ab, w), normal);
        const auto inside =
            hn::And(hn::And(hn::Ge(s, zero), hn::Ge(t, zero)),
                    hn::And(hn::Le(hn::Add(s, t), normal_sq), hn::Gt(normal_sq, zero)));
        const V to_edges =
            hn::Min(hn::Min(segmentDistanceSq(d, w, ab), segmentDistanceSq(d, w, ac)),
                    segmentDistanceSq(d, w - ab, ac - ab));
        const V to_plane = hn::Mul(height, hn::Div(height, normal_sq));
        least = hn::Min(least, hn::IfThenElse(inside, to_plane, to_edges));
    }
    return hn::GetLane(hn::MinOfLanes(d, least));
}

}  // namespace pietra::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra {

HWY_EXPORT(place);
HWY_EXPORT(foldingTriangles);
HWY_EXPORT(fanDistanceSq);

EdgeKernels chooseEdgeKernels() {
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    return {&HWY_DYNAMIC_DISPATCH(place), &HWY_DYNAMIC_DISPATCH(foldingTriangles),
            &HWY_DYNAMIC_DISPATCH(fanDistanceSq)};
}

}  // namespace pietra
#endif
