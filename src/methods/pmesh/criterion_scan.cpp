#include "methods/pmesh/criterion_scan.h"

#include <bit>
#include <utility>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "methods/pmesh/criterion_scan.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

#ifndef PIETRA_PMESH_CERTAIN_BITS
#define PIETRA_PMESH_CERTAIN_BITS
namespace pietra::pmesh {

/// Of one test on some vertices: a bit each.
struct CertainBits {
    uint64_t yes = 0, open = 0;
};
struct CertainScan {
    CertainBits split, last;
    size_t count = 0;  ///< vertices looked at
};

}  // namespace pietra::pmesh
#endif

HWY_BEFORE_NAMESPACE();
namespace pietra::pmesh::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = HWY_CAPPED(float, 16);
using I = hn::Rebind<int32_t, F>;
using U = hn::Rebind<uint32_t, F>;
using VF = hn::Vec<F>;
using VU = hn::Vec<U>;

/// decodeRounded<11>(): such a code is the upper part of a float, but for those below 2048.
HWY_INLINE VF radiusOf(const VU code) {
    const F f;
    const U u;
    const VU bits = hn::Add(hn::ShiftLeft<12>(code), hn::Set(u, (127 + 10) << 23));
    const VF small = hn::ConvertTo(f, hn::BitCast(I(), code));
    return hn::IfThenElse(hn::RebindMask(f, hn::Lt(code, hn::Set(u, 2048))), small,
                          hn::BitCast(f, bits));
}

struct Scanner {
    const Criterion& criterion;
    VF x, y, z, squared;  // from the eye

    struct Answer {
        hn::Mask<F> yes, maybe;
    };
    /// Relative errors are below 2^-20: a few roundings to 24 bits.
    HWY_INLINE Answer shows(const VF distance) const {
        const VF above = hn::Set(F(), 1 + 0x1p-19f), limit = hn::Mul(distance, distance);
        return {hn::Gt(limit, hn::Mul(squared, above)), hn::Ge(hn::Mul(limit, above), squared)};
    }

    /// Criterion::facesAway(), if the eye is so far off. Errors are relative to the terms, of which
    /// each is at most 16 times a coordinate.
    HWY_INLINE Answer facesAway(const VU normals, const VF radius) const {
        const F f;
        VF along = hn::Zero(f), terms = hn::Zero(f);
        const auto add = [&](const VF d, const VU low, const VU high) {
            const auto coordinate = [&](const VU bits) {
                return hn::ConvertTo(f, hn::ShiftRight<28>(hn::BitCast(I(), bits)));
            };
            along =
                hn::Add(along, hn::Min(hn::Mul(d, coordinate(low)), hn::Mul(d, coordinate(high))));
            terms = hn::Add(terms, hn::Abs(d));
        };
        add(x, hn::ShiftLeft<28>(normals), hn::ShiftLeft<24>(normals));
        add(y, hn::ShiftLeft<20>(normals), hn::ShiftLeft<16>(normals));
        add(z, hn::ShiftLeft<12>(normals), hn::ShiftLeft<8>(normals));
        const VF longest = hn::ConvertTo(f, hn::BitCast(I(), hn::ShiftRight<24>(normals)));
        const VF beyond = hn::Sub(hn::Add(along, along), hn::Mul(longest, radius));
        const VF margin = hn::Mul(terms, hn::Set(f, 16 * 0x1p-19f));
        return {hn::Gt(beyond, margin), hn::Ge(beyond, hn::Neg(margin))};
    }

    HWY_INLINE void test(const VU packed, const VU normals, size_t at, CertainBits& result) const {
        const F f;
        const VF radius = radiusOf(hn::And(packed, hn::Set(U(), 0xffff)));
        const auto error = hn::BitCast(I(), hn::ShiftRight<16>(packed));
        const auto reach = hn::GatherIndex(I(), criterion.reach.data(), error);
        const VF distance = hn::Add(hn::ConvertTo(f, reach), radius);
        Answer answer = shows(distance);
        if (criterion.hides_backs) {
            const Answer away = facesAway(normals, radius);
            const Answer anyhow = shows(
                hn::Add(hn::ConvertTo(f, hn::ShiftRight<Criterion::kHiddenBits>(reach)), radius));
            answer.yes = hn::And(answer.yes, hn::Or(anyhow.yes, hn::Not(away.maybe)));
            answer.maybe = hn::And(answer.maybe, hn::Or(anyhow.maybe, hn::Not(away.yes)));
        }
        // Depths below the sides have absolute errors, relative to the distance.
        VF depth = radius;
        for (const Vec3i& n : criterion.side) {
            const auto scaled = [&](int32_t c) {
                return hn::Set(f, float(c) * (1.0f / (1 << Criterion::kSideBits)));
            };
            const VF inside = hn::Add(hn::Add(hn::Mul(x, scaled(n.x)), hn::Mul(y, scaled(n.y))),
                                      hn::Mul(z, scaled(n.z)));
            depth = hn::Min(depth, hn::Add(inside, radius));
        }
        const VF margin = hn::Add(hn::Mul(distance, hn::Set(f, 0x1p-19f)), hn::Set(f, 2));
        const auto in_picture = hn::Ge(depth, margin);
        const auto yes = hn::And(answer.yes, in_picture);
        put(yes, at, result.yes);
        put(hn::AndNot(yes, answer.maybe), at, result.open);
    }

    static HWY_INLINE void put(hn::Mask<F> mask, size_t at, uint64_t& bits) {
        alignas(8) uint8_t bytes[8] = {};
        hn::StoreMaskBits(F(), mask, bytes);
        bits |= uint64_t(bytes[0] | bytes[1] << 8) << at;
    }
};

CertainScan scanCertain(const Criterion& criterion, const Vertex* vertex,
                        const VertexCriteria* criteria, size_t count) {
    const F f;
    const I i;
    const U u;
    CertainScan scan;
    const size_t lanes = hn::Lanes(f);
    for (; scan.count + lanes <= count; scan.count += lanes) {
        hn::Vec<I> x, y, z, normal;
        hn::LoadInterleaved4(i, &vertex[scan.count].x, x, y, z, normal);
        const VF dx = hn::ConvertTo(f, hn::Sub(x, hn::Set(i, criterion.eye.x)));
        const VF dy = hn::ConvertTo(f, hn::Sub(y, hn::Set(i, criterion.eye.y)));
        const VF dz = hn::ConvertTo(f, hn::Sub(z, hn::Set(i, criterion.eye.z)));
        const VF squared = hn::Add(hn::Add(hn::Mul(dx, dx), hn::Mul(dy, dy)), hn::Mul(dz, dz));
        const Scanner scanner{criterion, dx, dy, dz, squared};
        VU split, split_normals, last, last_normals;
        hn::LoadInterleaved4(u, reinterpret_cast<const uint32_t*>(criteria + scan.count), split,
                             split_normals, last, last_normals);
        scanner.test(split, split_normals, scan.count, scan.split);
        scanner.test(last, last_normals, scan.count, scan.last);
    }
    return scan;
}

}  // namespace pietra::pmesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra::pmesh {

HWY_EXPORT(scanCertain);

ScanBits scanVertices(const Criterion& criterion, const Vertex* vertex,
                      const VertexCriteria* criteria, size_t count) {
    CertainScan scan = HWY_DYNAMIC_DISPATCH(scanCertain)(criterion, vertex, criteria, count);
    if (criterion.occlusion)  // then what shows may be hidden
        for (CertainBits* bits : {&scan.split, &scan.last})
            bits->open |= std::exchange(bits->yes, 0);
    uint64_t split = scan.split.yes, last = scan.last.yes;
    const uint64_t rest = scan.count < 64 ? ~uint64_t(0) << scan.count : 0;
    const uint64_t all = count < 64 ? (uint64_t(1) << count) - 1 : ~uint64_t(0);
    for (uint64_t open = (scan.split.open | rest) & all; open != 0; open &= open - 1) {
        const auto k = size_t(std::countr_zero(open));
        split |= uint64_t(criterion.needsSplit(vertex[k], criteria[k])) << k;
    }
    for (uint64_t open = (scan.last.open | rest) & all; open != 0; open &= open - 1) {
        const auto k = size_t(std::countr_zero(open));
        last |= uint64_t(criterion.needsLast(vertex[k], criteria[k])) << k;
    }
    return {split, ~last & all};
}

}  // namespace pietra::pmesh
#endif
