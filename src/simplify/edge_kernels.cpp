#include "simplify/edge_kernels.h"

#include <cstddef>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "simplify/edge_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using D = HWY_CAPPED(float, 8);
using V = hn::Vec<D>;
constexpr size_t kLanes = HWY_MIN(HWY_LANES(float), 8);

struct V3 {
    V x, y, z;
};
HWY_INLINE V3 operator+(const V3& a, const V3& b) {
    return {hn::Add(a.x, b.x), hn::Add(a.y, b.y), hn::Add(a.z, b.z)};
}
HWY_INLINE V3 operator-(const V3& a, const V3& b) {
    return {hn::Sub(a.x, b.x), hn::Sub(a.y, b.y), hn::Sub(a.z, b.z)};
}
HWY_INLINE V dot(const V3& a, const V3& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE V3 cross(const V3& a, const V3& b) {
    return {hn::Sub(hn::Mul(a.y, b.z), hn::Mul(a.z, b.y)),
            hn::Sub(hn::Mul(a.z, b.x), hn::Mul(a.x, b.z)),
            hn::Sub(hn::Mul(a.x, b.y), hn::Mul(a.y, b.x))};
}
template <class M>
HWY_INLINE V3 select(M mask, const V3& yes, const V3& no) {
    return {hn::IfThenElse(mask, yes.x, no.x), hn::IfThenElse(mask, yes.y, no.y),
            hn::IfThenElse(mask, yes.z, no.z)};
}

/// Four floats of each lane's record.
struct Columns {
    V c0, c1, c2, c3;
    HWY_INLINE V3 xyz() const { return {c0, c1, c2}; }
};

static_assert(offsetof(Quadric, a02) == 16 && offsetof(Quadric, b0) == 32);

#if HWY_TARGET == HWY_SCALAR

using Row = Columns;

HWY_INLINE Row loadRow(const void* record, size_t row) {
    const float* f = static_cast<const float*>(record) + 4 * row;
    const D d;
    return {hn::Load(d, f), hn::Load(d, f + 1), hn::Load(d, f + 2), hn::Load(d, f + 3)};
}

HWY_INLINE Row addRows(const Row& a, const Row& b) {
    return {hn::Add(a.c0, b.c0), hn::Add(a.c1, b.c1), hn::Add(a.c2, b.c2), hn::Add(a.c3, b.c3)};
}

template <class Load>
HWY_INLINE Columns gather(const Load& load) {
    return load(0);
}

#else

using D4 = HWY_CAPPED(float, 4);
using Row = hn::Vec<D4>;

HWY_INLINE Row loadRow(const void* record, size_t row) {
    return hn::Load(D4(), static_cast<const float*>(record) + 4 * row);
}

HWY_INLINE Row addRows(const Row& a, const Row& b) {
    return hn::Add(a, b);
}

HWY_INLINE Columns transpose(V r0, V r1, V r2, V r3) {
    const D d;
    const V t0 = hn::InterleaveLower(d, r0, r2), t1 = hn::InterleaveLower(d, r1, r3);
    const V t2 = hn::InterleaveUpper(d, r0, r2), t3 = hn::InterleaveUpper(d, r1, r3);
    return {hn::InterleaveLower(d, t0, t1), hn::InterleaveUpper(d, t0, t1),
            hn::InterleaveLower(d, t2, t3), hn::InterleaveUpper(d, t2, t3)};
}

/// load(i): the four floats of lane i's record.
template <class Load>
HWY_INLINE Columns gather(const Load& load) {
#if HWY_MAX_BYTES >= 32
    const D d;
    const auto row = [&](size_t i) HWY_ATTR { return hn::Combine(d, load(i + 4), load(i)); };
    return transpose(row(0), row(1), row(2), row(3));
#else
    return transpose(load(0), load(1), load(2), load(3));
#endif
}

#endif

struct Symmetric {
    V a00, a11, a22, a01, a02, a12;
    HWY_INLINE V3 times(const V3& z) const {
        return {dot({a00, a01, a02}, z), dot({a01, a11, a12}, z), dot({a02, a12, a22}, z)};
    }
    /// Solves A z = -g by LDL'.
    HWY_INLINE V3 solveNegative(const V3& g) const {
        const D d;
        const V r0 = hn::Div(hn::Set(d, 1.0f), a00);
        const V l10 = hn::Mul(a01, r0), l20 = hn::Mul(a02, r0);
        const V d1 = hn::Sub(a11, hn::Mul(l10, a01));
        const V t21 = hn::Sub(a12, hn::Mul(l20, a01));
        const V r1 = hn::Div(hn::Set(d, 1.0f), d1);
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

HWY_INLINE V snap(V p, const SnapGrid& grid, float low, float high) {
    const D d;
    const V scaled = hn::Add(hn::Mul(p, hn::Set(d, grid.inverse_step)), hn::Set(d, 0.5f));
    const V snapped = hn::Mul(hn::Floor(scaled), hn::Set(d, grid.step));
    // note: adding zero turns -0 into 0, so that equal positions have equal bytes.
    return hn::Add(hn::Max(hn::Set(d, low), hn::Min(hn::Set(d, high), snapped)), hn::Zero(d));
}

/// f(z) = z'Az + 2 g'z + c around u, the sum of both quadrics.
HWY_INLINE void placeLanes(const Point* points, const Quadric* quadrics, const SnapGrid& grid,
                           EdgeBatch& batch, size_t first) {
    const D d;
    const hn::RebindToSigned<D> di;
    const uint32_t *u = batch.u + first, *v = batch.v + first;
    const Columns at_u = gather([&](size_t i) HWY_ATTR { return loadRow(points + u[i], 0); });
    const Columns at_v = gather([&](size_t i) HWY_ATTR { return loadRow(points + v[i], 0); });
    const auto sumRow = [&](size_t row) HWY_ATTR {
        return gather([&](size_t i) HWY_ATTR {
            return addRows(loadRow(quadrics + u[i], row), loadRow(quadrics + v[i], row));
        });
    };
    const auto rowOfV = [&](size_t row) HWY_ATTR {
        return gather([&](size_t i) HWY_ATTR { return loadRow(quadrics + v[i], row); });
    };
    const Columns v0 = rowOfV(0), v1 = rowOfV(1), v2 = rowOfV(2);
    const Columns s0 = sumRow(0), s1 = sumRow(1), s2 = sumRow(2);

    const V3 edge = at_v.xyz() - at_u.xyz();
    const V3 back = at_u.xyz() - at_v.xyz();
    const V3 moved = Symmetric{v0.c0, v0.c1, v0.c2, v0.c3, v1.c0, v1.c1}.times(back);
    const V3 b = v2.xyz();
    const V3 g = s2.xyz() + moved;
    const V c = hn::Add(s1.c2, dot(moved + b + b, back));
    const Symmetric a{s0.c0, s0.c1, s0.c2, s0.c3, s1.c0, s1.c1};

    const V3 optimum = a.solveNegative(g);
    const V half = hn::Set(d, 0.5f);
    const V3 middle{hn::Mul(edge.x, half), hn::Mul(edge.y, half), hn::Mul(edge.z, half)};
    const V3 off = optimum - middle;
    const V3 place = at_u.xyz() + select(hn::Le(dot(off, off), dot(edge, edge)), optimum, middle);
    const V3 snapped{snap(place.x, grid, grid.low.x, grid.high.x),
                     snap(place.y, grid, grid.low.y, grid.high.y),
                     snap(place.z, grid, grid.low.z, grid.high.z)};

    const auto rank_mask = hn::Set(di, int32_t(kRankMask));
    const auto rank_u = hn::And(hn::BitCast(di, at_u.c3), rank_mask);
    const auto rank_v = hn::And(hn::BitCast(di, at_v.c3), rank_mask);
    V3 to = select(hn::RebindMask(d, hn::Gt(rank_u, rank_v)), at_u.xyz(), snapped);
    to = select(hn::RebindMask(d, hn::Gt(rank_v, rank_u)), at_v.xyz(), to);

    const V3 z = to - at_u.xyz();
    const V cost = hn::Add(dot(a.times(z) + g + g, z), c);
    hn::Store(hn::Max(cost, hn::Zero(d)), d, batch.cost + first);
    hn::Store(to.x, d, batch.x + first);
    hn::Store(to.y, d, batch.y + first);
    hn::Store(to.z, d, batch.z + first);
}

void place(const Point* points, const Quadric* quadrics, const SnapGrid& grid, EdgeBatch& batch) {
    for (size_t i = 0; i < kBatch; i += kLanes) placeLanes(points, quadrics, grid, batch, i);
}

HWY_INLINE uint32_t foldingLanes(const Point* points, const uint32_t* apex, const uint32_t* next,
                                 const uint32_t* previous, const V3& to) {
    const D d;
    const auto positions = [&](const uint32_t* ids) HWY_ATTR {
        return gather([&](size_t i) HWY_ATTR { return loadRow(points + ids[i], 0); }).xyz();
    };
    const V3 from = positions(apex), n = positions(next), p = positions(previous);
    const V3 new_n = n - to, new_p = p - to, opposite = n - p;
    const V3 old_normal = cross(n - from, p - from), new_normal = cross(new_n, new_p);
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
    return uint32_t(bits[0]) & ((1u << kLanes) - 1);
}

uint32_t foldingTriangles(const Point* points, const uint32_t* apex, const uint32_t* next,
                          const uint32_t* previous, const Vec3f& to) {
    const D d;
    const V3 at{hn::Set(d, to.x), hn::Set(d, to.y), hn::Set(d, to.z)};
    uint32_t bits = 0;
    for (size_t i = 0; i < kBatch; i += kLanes)
        bits |= foldingLanes(points, apex + i, next + i, previous + i, at) << i;
    return bits;
}

}  // namespace pietra::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra {

HWY_EXPORT(place);
HWY_EXPORT(foldingTriangles);

EdgeKernels chooseEdgeKernels() {
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
    return {&HWY_DYNAMIC_DISPATCH(place), &HWY_DYNAMIC_DISPATCH(foldingTriangles)};
}

}  // namespace pietra
#endif
