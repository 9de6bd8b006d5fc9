#include "render/raster/shade_kernel.h"

#include "render/shading.h"

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/shade_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using DI = hn::CappedTag<int32_t, kShadeLanes>;
using DF = hn::CappedTag<float, kShadeLanes>;
using VI = hn::Vec<DI>;
using VF = hn::Vec<DF>;
using MF = hn::Mask<DF>;

HWY_INLINE VF set(float value) {
    return hn::Set(DF(), value);
}
HWY_INLINE VF positive(VF v) {
    return hn::Max(v, hn::Zero(DF()));
}

struct Vec {
    VF x, y, z;
};

HWY_INLINE VF dot(const Vec& a, const Vec& b) {
    return hn::Add(hn::Add(hn::Mul(a.x, b.x), hn::Mul(a.y, b.y)), hn::Mul(a.z, b.z));
}
HWY_INLINE VF dot(const Vec& a, const Vec3f& b) {
    return dot(a, Vec{set(b.x), set(b.y), set(b.z)});
}
HWY_INLINE Vec scaled(const Vec& a, VF s) {
    return {hn::Mul(a.x, s), hn::Mul(a.y, s), hn::Mul(a.z, s)};
}
/// Zero vectors stay zero.
HWY_INLINE Vec normalized(const Vec& a) {
    const VF square = dot(a, a);
    const VF inverse = hn::Div(set(1), hn::Sqrt(square));
    return scaled(a, hn::IfThenElseZero(hn::Gt(square, hn::Zero(DF())), inverse));
}

/// The direction of decodeNormal() of octahedral.h, not of unit length; the two numbers are the
/// halves of a lane.
HWY_INLINE Vec decode(VI packed) {
    const DF df;
    const VF one = set(32767.0f), zero = hn::Zero(df);
    const VF x = hn::ConvertTo(df, hn::ShiftRight<16>(hn::ShiftLeft<16>(packed)));
    const VF y = hn::ConvertTo(df, hn::ShiftRight<16>(packed));
    const VF z = hn::Sub(hn::Sub(one, hn::Abs(x)), hn::Abs(y));
    const MF folded = hn::Lt(z, zero);
    const VF folded_x = hn::CopySign(hn::Sub(one, hn::Abs(y)), x);
    const VF folded_y = hn::CopySign(hn::Sub(one, hn::Abs(x)), y);
    return {hn::IfThenElse(folded, folded_x, x), hn::IfThenElse(folded, folded_y, y), z};
}

/// One vector of lanes, from `at` on.
class Interpolator {
public:
    HWY_INLINE Interpolator(const ShadeView& view, ShadeLanes& lanes, size_t at)
        : view_(view), lanes_(lanes), at_(at) {}

    HWY_INLINE void run() {
        const DI di;
        const VI place = hn::Load(di, lanes_.place + at_), mask = hn::Set(di, kPlaceMask);
        const VI pixel_x = hn::And(place, mask);
        const VI pixel_y = hn::And(hn::ShiftRight<kPlaceBits>(place), mask);
        findWeights(pixel_x, pixel_y);
        const Vec world = interpolatedNormal();
        const Vec n =
            normalized({dot(world, view_.right), dot(world, view_.up), dot(world, view_.back)});
        const Vec eye = toEye(pixel_x, pixel_y);
        store(turned(n, eye), lanes_.normal);
        store(eye, lanes_.to_eye);
        store({weight_[0], weight_[1], weight_[2]}, lanes_.weight);
    }

private:
    HWY_INLINE void findWeights(VI pixel_x, VI pixel_y) {
        const DI di;
        const DF df;
        const VI half = hn::Set(di, kHalfPixel);
        const VI at_x = hn::Add(hn::ShiftLeft<kSubpixelBits>(pixel_x), half);
        const VI at_y = hn::Add(hn::ShiftLeft<kSubpixelBits>(pixel_y), half);
        VF x[3], y[3], inv_depth[3];
        for (int k = 0; k < 3; ++k) {
            VI vx, vy, vd;
            hn::LoadInterleaved4(di, reinterpret_cast<const int32_t*>(lanes_.corner[k] + at_), vx,
                                 vy, vd, normal_[k]);
            x[k] = hn::ConvertTo(df, hn::Sub(vx, at_x));
            y[k] = hn::ConvertTo(df, hn::Sub(vy, at_y));
            inv_depth[k] = hn::BitCast(df, vd);
        }
        VF e[3];
        for (int k = 0; k < 3; ++k) {
            const int a = (k + 1) % 3, b = (k + 2) % 3;
            e[k] = hn::Sub(hn::Mul(x[a], y[b]), hn::Mul(x[b], y[a]));
        }
        back_ = hn::Gt(hn::Add(hn::Add(e[0], e[1]), e[2]), hn::Zero(df));
        for (int k = 0; k < 3; ++k) e[k] = hn::Mul(e[k], inv_depth[k]);
        useGiven(e);
        // Of the sign of their sum where the pixel's centre is inside; else the nearest point of
        // the triangle, about.
        const VF direction = hn::Add(hn::Add(e[0], e[1]), e[2]);
        for (int k = 0; k < 3; ++k) e[k] = positive(hn::Mul(e[k], hn::CopySign(set(1), direction)));
        const VF sum = hn::Add(hn::Add(e[0], e[1]), e[2]);
        // Zero for a sliver whose area is lost to rounding.
        const VF inverse = hn::Div(set(1), sum);
        const MF usable = hn::Gt(sum, hn::Zero(df));
        for (int k = 0; k < 3; ++k)
            weight_[k] = hn::IfThenElse(usable, hn::Mul(e[k], inverse), set(k == 0 ? 1.0f : 0.0f));
    }

    HWY_INLINE void useGiven(VF e[3]) {
        const DI di;
        const DF df;
        if (HWY_LIKELY(!lanes_.any_given)) return;
        const auto given = hn::RebindMask(df, hn::MaskFromVec(hn::Load(di, lanes_.given + at_)));
        for (int k = 0; k < 3; ++k)
            e[k] = hn::IfThenElse(given, hn::Load(df, lanes_.given_weight[k] + at_), e[k]);
        const auto back =
            hn::RebindMask(df, hn::MaskFromVec(hn::Load(di, lanes_.given_back + at_)));
        back_ = hn::Or(hn::And(given, back), hn::AndNot(given, back_));
    }

    /// The weighted sum of the corners' unit normals, of any length: multiplied by all three
    /// lengths it needs no division.
    HWY_INLINE Vec interpolatedNormal() const {
        Vec n[3];
        VF square[3];
        for (int k = 0; k < 3; ++k) {
            n[k] = decode(normal_[k]);
            square[k] = dot(n[k], n[k]);
        }
        Vec sum;
        for (int k = 0; k < 3; ++k) {
            const VF lengths = hn::Sqrt(hn::Mul(square[(k + 1) % 3], square[(k + 2) % 3]));
            const Vec part = scaled(n[k], hn::Mul(weight_[k], lengths));
            sum = k == 0
                      ? part
                      : Vec{hn::Add(sum.x, part.x), hn::Add(sum.y, part.y), hn::Add(sum.z, part.z)};
        }
        return sum;
    }

    HWY_INLINE Vec toEye(VI pixel_x, VI pixel_y) const {
        const DF df;
        const VF half = set(0.5f), inv_focal = set(view_.inv_focal);
        const VF x = hn::Sub(set(view_.centre_x), hn::Add(hn::ConvertTo(df, pixel_x), half));
        const VF y = hn::Sub(hn::Add(hn::ConvertTo(df, pixel_y), half), set(view_.centre_y));
        return normalized({hn::Mul(x, inv_focal), hn::Mul(y, inv_focal), set(1)});
    }

    /// A sliver's side may be lost to rounding, and near a silhouette normals point away from faces
    /// that are seen: only both together, or a normal that is clearly wrong, turn it round.
    HWY_INLINE Vec turned(const Vec& n, const Vec& eye) const {
        if (!lanes_.both_sides) return n;
        const VF limit = hn::IfThenElse(back_, hn::Zero(DF()), set(-0.25f));
        return scaled(n, hn::IfThenElse(hn::Lt(dot(n, eye), limit), set(-1), set(1)));
    }

    HWY_INLINE void store(const Vec& v, float (*out)[kShadeLanes]) const {
        const DF df;
        hn::Store(v.x, df, out[0] + at_);
        hn::Store(v.y, df, out[1] + at_);
        hn::Store(v.z, df, out[2] + at_);
    }

    const ShadeView& view_;
    ShadeLanes& lanes_;
    size_t at_;
    VI normal_[3];
    VF weight_[3];
    MF back_;
};

void InterpolateLanes(const ShadeView& view, ShadeLanes& lanes) {
    for (size_t at = 0; at < size_t(kShadeLanes); at += hn::Lanes(DF()))
        Interpolator(view, lanes, at).run();
}

HWY_INLINE VI tableIndex(VF linear) {
    const VF clamped = hn::Min(positive(linear), set(1));
    return hn::NearestInt(hn::Mul(clamped, set(float(kSrgbEntries - 1))));
}

void LeaveUnlit(ShadeLanes& lanes) {
    const DF df;
    for (int c = 0; c < 3; ++c)
        for (size_t at = 0; at < size_t(kShadeLanes); at += hn::Lanes(df))
            hn::Store(tableIndex(hn::Load(df, lanes.base[c] + at)), DI(), lanes.lit[c] + at);
}

void ShowNormals(ShadeLanes& lanes) {
    const DF df;
    const VF half = set(0.5f * float(kSrgbEntries - 1));
    for (int c = 0; c < 3; ++c)
        for (size_t at = 0; at < size_t(kShadeLanes); at += hn::Lanes(df)) {
            const VF n = hn::Load(df, lanes.normal[c] + at);
            hn::Store(hn::NearestInt(hn::Add(hn::Mul(n, half), half)), DI(), lanes.lit[c] + at);
        }
}

void LightLanes(const ShadeView& view, ShadeLanes& lanes) {
    const DF df;
    for (size_t at = 0; at < size_t(kShadeLanes); at += hn::Lanes(df)) {
        const auto load = [&](const float(*in)[kShadeLanes]) HWY_ATTR {
            return Vec{hn::Load(df, in[0] + at), hn::Load(df, in[1] + at),
                       hn::Load(df, in[2] + at)};
        };
        const Vec n = load(lanes.normal), eye = load(lanes.to_eye);
        const Vec half =
            normalized({hn::Add(eye.x, set(view.light.x)), hn::Add(eye.y, set(view.light.y)),
                        hn::Add(eye.z, set(view.light.z))});
        const VF key = positive(dot(n, view.light));
        const VF front = hn::Mul(positive(dot(n, eye)), set(kEyeLight));
        const VF sky = hn::Add(set(0.5f), hn::Mul(set(0.5f), n.y));
        const VF ground = hn::Sub(set(1), sky);
        VF shine = hn::IfThenElseZero(hn::Gt(key, hn::Zero(df)), positive(dot(n, half)));
        for (int k = 0; k < 5; ++k) shine = hn::Mul(shine, shine);  // the 32nd power
        shine = hn::Mul(shine, set(kShine));
        for (int c = 0; c < 3; ++c) {
            VF light = hn::Add(front, hn::Mul(key, set(kKeyLight[c])));
            light = hn::Add(light, hn::Mul(sky, set(kSkyLight[c])));
            light = hn::Add(light, hn::Mul(ground, set(kGroundLight[c])));
            const VF diffuse = hn::Mul(light, hn::Load(df, lanes.base[c] + at));
            hn::Store(tableIndex(hn::Add(diffuse, shine)), DI(), lanes.lit[c] + at);
        }
    }
}

}  // namespace HWY_NAMESPACE
}  // namespace pietra
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra {

HWY_EXPORT(InterpolateLanes);
HWY_EXPORT(LightLanes);
HWY_EXPORT(LeaveUnlit);
HWY_EXPORT(ShowNormals);

void interpolateLanes(const ShadeView& view, ShadeLanes& lanes) {
    HWY_DYNAMIC_DISPATCH(InterpolateLanes)(view, lanes);
}

void lightLanes(const ShadeView& view, ShadeLanes& lanes) {
    HWY_DYNAMIC_DISPATCH(LightLanes)(view, lanes);
}

void showNormals(ShadeLanes& lanes) {
    HWY_DYNAMIC_DISPATCH(ShowNormals)(lanes);
}

void leaveUnlit(ShadeLanes& lanes) {
    HWY_DYNAMIC_DISPATCH(LeaveUnlit)(lanes);
}

}  // namespace pietra
#endif
