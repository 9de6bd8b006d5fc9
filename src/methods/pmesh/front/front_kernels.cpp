#include "methods/pmesh/front/front_kernels.h"

#include <bit>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "methods/pmesh/front/front_kernels.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra::pmesh::HWY_NAMESPACE {
namespace hn = hwy::HWY_NAMESPACE;

using F = HWY_CAPPED(float, 16);
using VF = hn::Vec<F>;

HWY_INLINE VF loadWords(const uint16_t* from) {
    const hn::Rebind<uint16_t, F> words;
    return hn::ConvertTo(F(), hn::PromoteTo(hn::Rebind<int32_t, F>(), hn::Load(words, from)));
}

HWY_INLINE uint32_t needed(const FrontView& view, const CriterionColumns& c, size_t at) {
    const F f;
    VF min[3], max[3], squared = hn::Zero(f);
    for (size_t k = 0; k < 3; ++k) {
        min[k] = loadWords(&c.min[k][at]);
        max[k] = loadWords(&c.max[k][at]);
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
    const VF error = hn::BitCast(
        f, hn::ShiftLeft<16>(hn::PromoteTo(u, hn::Load(words, &c.error[at]))));
    const VF rest = hn::Add(hn::Mul(error, hn::Set(f, view.reach)),
                            hn::Mul(inside, hn::Set(f, FrontView::kOutside)));
    const auto shows = hn::Gt(hn::Mul(rest, hn::Max(rest, hn::Zero(f))), squared);
    alignas(8) uint8_t bytes[8] = {};
    hn::StoreMaskBits(f, shows, bytes);
    return bytes[0] | uint32_t(bytes[1]) << 8;
}

uint32_t scanColumns(const FrontView& view, const CriterionColumns& columns) {
    uint32_t result = 0;
    for (size_t at = 0; at < kPageSlots; at += hn::Lanes(F()))
        result |= needed(view, columns, at) << at;
    return result;
}

PageScan scan(const FrontView& view, const FrontPage& page) {
    return {scanColumns(view, page.birth), scanColumns(view, page.next)};
}

/// Sixty-four bits that end with the byte of the leaf tell the owner, mostly.
void find(const FrontIndex& index, const Leaf* leaf, uint32_t* slot, size_t count) {
    const HWY_CAPPED(uint64_t, 8) u64;
    const hn::RebindToSigned<decltype(u64)> i64;
    const hn::Rebind<uint32_t, decltype(u64)> u32;
    const hn::Rebind<int32_t, decltype(u64)> i32;
    const size_t lanes = hn::Lanes(u64);
    const auto* bits = reinterpret_cast<const uint64_t*>(
        reinterpret_cast<const uint8_t*>(index.active) - 7);
    for (size_t i = 0; i < count; i += lanes) {
        const auto l = hn::LoadU(u32, leaf + i);
        const auto at = hn::PromoteTo(u64, l);
        const auto window = hn::GatherOffset(u64, bits, hn::BitCast(i64, hn::ShiftRight<3>(at)));
        // The highest bit, of 62 down, is the exponent of a double; where no bit beside it makes
        // that round up.
        const auto below =
            hn::ShiftRight<1>(hn::Shl(window, hn::AndNot(at, hn::Set(u64, 7))));
        const auto highest = hn::ConvertTo(
            hn::Rebind<double, decltype(u64)>(),
            hn::BitCast(i64, hn::AndNot(hn::ShiftRight<1>(below), below)));
        const auto distance = hn::TruncateTo(
            u32, hn::Sub(hn::Set(u64, 1023 + 62), hn::ShiftRight<52>(hn::BitCast(u64, highest))));
        auto owner = hn::Sub(l, distance);
        if (HWY_UNLIKELY(!hn::AllFalse(u64, hn::Eq(below, hn::Zero(u64))))) {
            HWY_ALIGN uint32_t owners[8];
            for (size_t k = 0; k < lanes; ++k) owners[k] = ownerOf(index, leaf[i + k]);
            owner = hn::Load(u32, owners);
        }
        const auto in_block = hn::And(
            hn::BitCast(u32, hn::GatherOffset(i32, reinterpret_cast<const int32_t*>(index.slot),
                                              hn::BitCast(i32, hn::Add(owner, owner)))),
            hn::Set(u32, 0xffff));
        hn::StoreU(hn::Or(hn::And(owner, hn::Set(u32, ~(kBlockLeaves - 1))), in_block), u32,
                   slot + i);
    }
}

}  // namespace pietra::pmesh::HWY_NAMESPACE
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra::pmesh {

HWY_EXPORT(scan);
HWY_EXPORT(scanColumns);
HWY_EXPORT(find);

PageScan scanPage(const FrontView& view, const FrontPage& page) {
    return HWY_DYNAMIC_DISPATCH(scan)(view, page);
}

uint32_t scanSplits(const FrontView& view, const FrontPage& page) {
    return HWY_DYNAMIC_DISPATCH(scanColumns)(view, page.next);
}

void findSlots(const FrontIndex& index, const Leaf* leaf, uint32_t* slot, size_t count) {
    HWY_DYNAMIC_DISPATCH(find)(index, leaf, slot, count);
}

Leaf ownerOf(const FrontIndex& index, Leaf leaf) {
    size_t word = leaf / 64;
    uint64_t bits = loadRelaxed(index.active[word]) << (63 - leaf % 64);
    if (bits != 0) return leaf - uint32_t(std::countl_zero(bits));
    constexpr size_t kBlockWords = kBlockLeaves / 64;
    while ((bits = loadRelaxed(index.active[--word])) == 0)
        while (word % kBlockWords == 0 && loadRelaxed(index.count[word / kBlockWords - 1]) == 0)
            word -= kBlockWords;
    return Leaf(word * 64 + 63 - size_t(std::countl_zero(bits)));
}

FrontView frontView(const View& view, const LeafForest& forest, double pixels) {
    const double unit = forest.gridUnit();
    const Vec3d eye = view.eye() / unit -
                      Vec3d(forest.grid_origin) / double(uint64_t(1) << forest.grid_shift);
    const double tan_x = view.size().width / (2 * view.focal_px());
    const double tan_y = view.size().height / (2 * view.focal_px());
    const Vec3d forward = -view.back();
    const std::array<Vec3d, 4> side{view.right() + tan_x * forward, -view.right() + tan_x * forward,
                                    view.up() + tan_y * forward, -view.up() + tan_y * forward};
    FrontView out;
    for (int k = 0; k < 3; ++k) out.eye[size_t(k)] = float(eye[k]);
    for (size_t i = 0; i < side.size(); ++i) {
        const Vec3d n = glm::normalize(side[i]);
        for (int k = 0; k < 3; ++k) out.side[i][size_t(k)] = float(n[k]);
        out.at_eye[i] = float(glm::dot(n, eye));
    }
    out.reach = float(view.focal_px() * (1 + tan_x * tan_x + tan_y * tan_y) / pixels);
    return out;
}

FrontView wholeView(bool all) {
    FrontView view;
    view.eye.fill(-1);  // not within a box
    view.reach = all ? 1e18f : 1e-18f;
    return view;
}

}  // namespace pietra::pmesh
#endif
