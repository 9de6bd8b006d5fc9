#include "methods/pmesh/front/split_page.h"

#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "methods/pmesh/front/split_page.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra::pmesh::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = HWY_CAPPED(float, 16);
using VF = hn::Vec<F>;

HWY_INLINE VF load(const uint16_t* from) {
    const hn::Rebind<uint16_t, F> words;
    return hn::ConvertTo(F(), hn::PromoteTo(hn::Rebind<int32_t, F>(), hn::Load(words, from)));
}

template <class M>
HWY_INLINE uint32_t bitsOf(const M& mask) {
    alignas(8) uint8_t bytes[8] = {};
    hn::StoreMaskBits(F(), mask, bytes);
    return bytes[0] | uint32_t(bytes[1]) << 8;
}

/// SplitView::shows() at both reaches: the second in the upper half.
HWY_INLINE uint32_t shows(const SplitView& view, const CriterionPage& c, size_t at) {
    const F f;
    VF min[3], max[3], squared = hn::Zero(f);
    for (size_t k = 0; k < 3; ++k) {
        min[k] = load(&c.min[k][at]);
        max[k] = load(&c.max[k][at]);
        const VF eye = hn::Set(f, view.eye[k]);
        const VF d = hn::Max(hn::Max(hn::Sub(min[k], eye), hn::Sub(eye, max[k])), hn::Zero(f));
        squared = hn::Add(squared, hn::Mul(d, d));
    }
    VF inside = hn::Zero(f);
    for (size_t i = 0; i < view.side.size(); ++i) {
        VF depth = hn::Set(f, -view.at_eye[i]);
        for (size_t k = 0; k < 3; ++k) {
            const float n = view.side[i][k];
            depth = hn::Add(depth, hn::Mul(n > 0 ? max[k] : min[k], hn::Set(f, n)));
        }
        inside = hn::Min(inside, depth);
    }
    const hn::Rebind<uint16_t, F> words;
    const hn::Rebind<uint32_t, F> u;
    const VF error =
        hn::BitCast(f, hn::ShiftLeft<16>(hn::PromoteTo(u, hn::Load(words, &c.error[at]))));
    const VF outside = hn::Mul(inside, hn::Set(f, SplitView::kOutside));
    const auto at_reach = [&](float reach) {
        const VF rest = hn::Add(hn::Mul(error, hn::Set(f, reach)), outside);
        return bitsOf(hn::Gt(hn::Mul(rest, hn::Max(rest, hn::Zero(f))), squared));
    };
    return at_reach(view.reach) | at_reach(view.reach * (1 / SplitView::kHidden)) << 16;
}

uint32_t needs(const SplitView& view, const CriterionPage& page) {
    uint32_t needed = 0, surely = 0;
    for (size_t at = 0; at < kPageVertices; at += hn::Lanes(F())) {
        const uint32_t bits = shows(view, page, at);
        needed |= (bits & 0xffff) << at;
        surely |= (bits >> 16) << at;
    }
    if (!view.hidesAny()) return needed;
    for (uint32_t maybe = needed & ~surely; maybe != 0; maybe &= maybe - 1) {
        const auto i = uint32_t(std::countr_zero(maybe));
        if (view.hides(page.get(i))) needed &= ~(1u << i);
    }
    return needed;
}

PageNeeds scan(const SplitView& view, const SplitPage& page) {
    return {needs(view, page.birth), needs(view, page.next)};
}

}  // namespace pietra::pmesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra::pmesh {

HWY_EXPORT(scan);
HWY_EXPORT(needs);

PageNeeds scanPage(const SplitView& view, const SplitPage& page) {
    return HWY_DYNAMIC_DISPATCH(scan)(view, page);
}

uint32_t scanNext(const SplitView& view, const SplitPage& page) {
    return HWY_DYNAMIC_DISPATCH(needs)(view, page.next);
}

}  // namespace pietra::pmesh
#endif
