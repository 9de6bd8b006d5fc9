#include "render/raster/transform.h"

#include <cstring>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/transform.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

using DI = hn::CappedTag<int32_t, 16>;
using DF = hn::CappedTag<float, 16>;
using VI = hn::Vec<DI>;
using VF = hn::Vec<DF>;

/// The transformation of one vector of vertices; the operations and their order are Projection's.
class Transformer {
public:
    HWY_INLINE explicit Transformer(const Projection& p) : p_(p) {
        const DI di;
        min_x_ = min_y_ = hn::Set(di, std::numeric_limits<int32_t>::max());
        max_x_ = max_y_ = hn::Set(di, std::numeric_limits<int32_t>::lowest());
        missing_ = in_front_ = hn::Zero(di);
        nearest_ = hn::Zero(DF());
    }

    HWY_INLINE void run(const int32_t* position, const int32_t* normal, int32_t* out) {
        const DI di;
        const DF df;
        VI px, py, pz;
        hn::LoadInterleaved3(di, position, px, py, pz);
        const VF dx = hn::ConvertTo(df, hn::Sub(px, hn::Set(di, p_.origin.x)));
        const VF dy = hn::ConvertTo(df, hn::Sub(py, hn::Set(di, p_.origin.y)));
        const VF dz = hn::ConvertTo(df, hn::Sub(pz, hn::Set(di, p_.origin.z)));
        const VF x = along(dx, dy, dz, p_.right, p_.offset.x);
        const VF y = along(dx, dy, dz, p_.up, p_.offset.y);
        const VF z = along(dx, dy, dz, p_.forward, p_.offset.z);

        const VF scale = hn::Set(df, p_.scale), guard = hn::Set(df, kGuardFixed);
        const VF inverse = hn::Div(hn::Set(df, 1.0f), z);
        const VF image_x = hn::Add(hn::Set(df, p_.centre_x), hn::Mul(hn::Mul(x, scale), inverse));
        const VF image_y = hn::Sub(hn::Set(df, p_.centre_y), hn::Mul(hn::Mul(y, scale), inverse));
        const auto in_front = hn::Ge(z, hn::Set(df, kNearDepth));
        const auto within =
            hn::And(hn::Le(hn::Abs(image_x), guard), hn::Le(hn::Abs(image_y), guard));
        const auto usable = hn::And(in_front, within);

        const VI reason = hn::IfThenElse(hn::RebindMask(di, in_front), hn::Set(di, kBeyond),
                                         hn::Set(di, kBehind));
        const auto keep = hn::RebindMask(di, usable);
        const VI fixed_x = hn::NearestInt(hn::IfThenElseZero(usable, image_x));
        const VI fixed_y = hn::NearestInt(hn::IfThenElseZero(usable, image_y));
        const VF inv_depth = hn::IfThenElseZero(usable, hn::Mul(inverse, hn::Set(df, p_.inv_step)));
        hn::StoreInterleaved4(hn::IfThenElse(keep, fixed_x, hn::Set(di, kNoImage)),
                              hn::IfThenElse(keep, fixed_y, reason), hn::BitCast(di, inv_depth),
                              hn::LoadU(di, normal), di, out);

        min_x_ = hn::IfThenElse(keep, hn::Min(min_x_, fixed_x), min_x_);
        min_y_ = hn::IfThenElse(keep, hn::Min(min_y_, fixed_y), min_y_);
        max_x_ = hn::IfThenElse(keep, hn::Max(max_x_, fixed_x), max_x_);
        max_y_ = hn::IfThenElse(keep, hn::Max(max_y_, fixed_y), max_y_);
        nearest_ = hn::Max(nearest_, inv_depth);
        missing_ = hn::Or(missing_, hn::VecFromMask(di, hn::Not(keep)));
        in_front_ = hn::Or(in_front_, hn::VecFromMask(di, hn::RebindMask(di, in_front)));
    }

    HWY_INLINE ImageBounds bounds() const {
        const DI di;
        return {hn::AllTrue(di, hn::Eq(missing_, hn::Zero(di))),
                hn::AllTrue(di, hn::Eq(in_front_, hn::Zero(di))),
                hn::GetLane(hn::MinOfLanes(di, min_x_)),
                hn::GetLane(hn::MinOfLanes(di, min_y_)),
                hn::GetLane(hn::MaxOfLanes(di, max_x_)),
                hn::GetLane(hn::MaxOfLanes(di, max_y_)),
                hn::GetLane(hn::MaxOfLanes(DF(), nearest_))};
    }

private:
    HWY_INLINE static VF along(VF dx, VF dy, VF dz, const Vec3f& axis, float offset) {
        const DF df;
        const VF xy = hn::Add(hn::Mul(dx, hn::Set(df, axis.x)), hn::Mul(dy, hn::Set(df, axis.y)));
        return hn::Add(hn::Add(xy, hn::Mul(dz, hn::Set(df, axis.z))), hn::Set(df, offset));
    }

    const Projection& p_;
    VI min_x_, min_y_, max_x_, max_y_, missing_, in_front_;
    VF nearest_;
};

ImageBounds TransformVertices(const Projection& projection, const int32_t* position,
                              const int32_t* normal, size_t count, int32_t* out) {
    constexpr size_t kMaxLanes = 16;
    const size_t lanes = hn::Lanes(DI());
    Transformer transformer(projection);
    size_t i = 0;
    for (; i + lanes <= count; i += lanes)
        transformer.run(position + 3 * i, normal + i, out + 4 * i);
    if (i < count) {
        // The rest, filled up with copies of the last one.
        int32_t rest_position[3 * kMaxLanes], rest_normal[kMaxLanes], rest_out[4 * kMaxLanes];
        for (size_t k = 0; k < lanes; ++k) {
            const size_t from = i + k < count ? i + k : count - 1;
            std::memcpy(rest_position + 3 * k, position + 3 * from, 12);
            rest_normal[k] = normal[from];
        }
        transformer.run(rest_position, rest_normal, rest_out);
        std::memcpy(out + 4 * i, rest_out, 16 * (count - i));
    }
    return transformer.bounds();
}

}  // namespace HWY_NAMESPACE
}  // namespace pietra
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra {

HWY_EXPORT(TransformVertices);

ImageBounds transformVertices(const Projection& projection, std::span<const Vec3i> position,
                              std::span<const OctNormal> normal, ScreenVertex* out) {
    static_assert(sizeof(Vec3i) == 12 && sizeof(OctNormal) == 4);
    return HWY_DYNAMIC_DISPATCH(TransformVertices)(
        projection, reinterpret_cast<const int32_t*>(position.data()),
        reinterpret_cast<const int32_t*>(normal.data()), position.size(),
        reinterpret_cast<int32_t*>(out));
}

}  // namespace pietra
#endif
