#include "render/raster/resolve_kernel.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/resolve_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using DK = hn::CappedTag<uint64_t, kCollectSlack>;
using VK = hn::Vec<DK>;

static_assert(sizeof(ShadeItem) == sizeof(uint64_t) && offsetof(ShadeItem, triangle) == 0);

ShadeItem* CollectItems(VisibilityKey* key, size_t count, const TriangleNumbers& triangles,
                        ShadeItem place, ShadeItem* items) {
    const DK dk;
    const size_t lanes = hn::Lanes(dk);
    const VK low = hn::Set(dk, 0xffffffffu),
             highest = hn::Set(dk, lowerWord(triangles.first_number));
    const VK limit = hn::Set(dk, triangles.count), first = hn::Set(dk, triangles.first);
    VK at = hn::ShiftLeft<32>(hn::Add(hn::Set(dk, place.place), hn::Iota(dk, 0)));
    const VK step = hn::Set(dk, uint64_t(lanes) << 32);
    auto* out = reinterpret_cast<uint64_t*>(items);
    size_t i = 0;
    for (; i + lanes <= count; i += lanes, at = hn::Add(at, step)) {
        const VK keys = hn::LoadU(dk, key + i);
        const VK number = hn::And(hn::Sub(highest, keys), low);
        const auto mine = hn::Lt(number, limit);
        if (hn::AllFalse(dk, mine)) continue;
        hn::StoreU(hn::IfThenElse(mine, hn::Or(keys, low), keys), dk, key + i);
        out += hn::CompressStore(hn::Or(hn::Add(number, first), at), mine, dk, out);
    }
    items = reinterpret_cast<ShadeItem*>(out);
    for (; i < count; ++i) {
        const uint32_t number = lowerWord(triangles.first_number) - uint32_t(key[i]);
        if (number >= triangles.count) continue;
        *items++ = {triangles.first + number, place.place + uint32_t(i)};
        key[i] |= kResolved;
    }
    return items;
}

size_t FinishSamples(const VisibilityKey* key, const Rgba8* from, size_t count, Rgba8* to,
                     float* depth) {
    const hn::CappedTag<float, 16> df;
    const hn::RebindToUnsigned<decltype(df)> du;
    const size_t lanes = hn::Lanes(df);
    const auto* colour = reinterpret_cast<const uint32_t*>(from);
    auto* out = reinterpret_cast<uint32_t*>(to);
    const auto one = hn::Set(df, 1.0f);
    size_t i = 0, covered = 0;
    for (; i + lanes <= count; i += lanes) {
        hn::Vec<decltype(du)> lower, upper;
        hn::LoadInterleaved2(du, reinterpret_cast<const uint32_t*>(key + i), lower, upper);
        const auto drawn = hn::Ne(upper, hn::Zero(du));
        // Of nothing: 1 / 0.
        hn::StoreU(hn::Div(one, hn::BitCast(df, upper)), df, depth + i);
        hn::BlendedStore(hn::LoadU(du, colour + i), drawn, du, out + i);
        covered += hn::CountTrue(du, drawn);
    }
    for (; i < count; ++i) {
        const auto upper = uint32_t(key[i] >> 32);
        depth[i] = 1.0f / std::bit_cast<float>(upper);
        if (upper == 0) continue;
        to[i] = from[i];
        ++covered;
    }
    return covered;
}

}  // namespace HWY_NAMESPACE
}  // namespace pietra
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra {

HWY_EXPORT(CollectItems);
HWY_EXPORT(FinishSamples);

ShadeItem* collectItems(VisibilityKey* key, size_t count, const TriangleNumbers& triangles,
                        ShadeItem place, ShadeItem* items) {
    return HWY_DYNAMIC_DISPATCH(CollectItems)(key, count, triangles, place, items);
}

size_t finishSamples(const VisibilityKey* key, const Rgba8* from, size_t count, Rgba8* to,
                     float* depth) {
    return HWY_DYNAMIC_DISPATCH(FinishSamples)(key, from, count, to, depth);
}

}  // namespace pietra
#endif
