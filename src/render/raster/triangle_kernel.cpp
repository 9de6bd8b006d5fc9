#include "render/raster/triangle_kernel.h"

#include <algorithm>

#undef HWY_TARGET_INCLUDE
#define HWY_TARGET_INCLUDE "render/raster/triangle_kernel.cpp"
#include <hwy/foreach_target.h>
#include <hwy/highway.h>

HWY_BEFORE_NAMESPACE();
namespace pietra {
namespace HWY_NAMESPACE {

namespace hn = hwy::HWY_NAMESPACE;

constexpr size_t kMaxLanes = 16;
using DI = hn::CappedTag<int32_t, kMaxLanes>;
using DU = hn::CappedTag<uint32_t, kMaxLanes>;
using DF = hn::CappedTag<float, kMaxLanes>;
using VI = hn::Vec<DI>;
using VU = hn::Vec<DU>;
using VF = hn::Vec<DF>;
using MI = hn::Mask<DI>;

/// Pixels of one row, for triangles larger than 2 x 2.
using RI = hn::CappedTag<int32_t, 8>;
using RF = hn::CappedTag<float, 8>;

template <class D>
HWY_INLINE uint32_t bitsOf(D d, hn::Mask<D> mask) {
    uint8_t bytes[8] = {};
    hn::StoreMaskBits(d, mask, bytes);
    return uint32_t(bytes[0]) | uint32_t(bytes[1]) << 8;
}

HWY_INLINE void put(VisibilityKey* key, int32_t depth_bits, uint32_t low) {
    *key = std::max(*key, VisibilityKey(uint32_t(depth_bits)) << 32 | low);
}

/// A line from corner to corner of one triangle a lane: its value at a point, and 0 or -1 as the
/// top-left rule wants.
struct LaneEdge {
    VI dx, dy, bias;
    HWY_INLINE LaneEdge(VI ax, VI ay, VI bx, VI by) {
        const DI di;
        const VI zero = hn::Zero(di);
        dx = hn::Sub(bx, ax);
        dy = hn::Sub(by, ay);
        const MI top_left = hn::Or(hn::Lt(dy, zero), hn::And(hn::Eq(dy, zero), hn::Gt(dx, zero)));
        bias = hn::VecFromMask(di, hn::Not(top_left));
    }
    /// At the origin of coordinates in which the line starts at (ax, ay).
    HWY_INLINE VI valueAtOrigin(VI ax, VI ay) const {
        return hn::Sub(hn::Mul(dy, ax), hn::Mul(dx, ay));
    }
};

/// A vector of triangles, positively oriented, with what all samples share.
struct Group {
    VI x[3], y[3];
    VF depth[3];
    VI area, low;
    VI min_x, max_x, min_y, max_y;
    MI drawn;  ///< small, with some area, not culled

    /// Puts triangles seen from the front into positive order.
    HWY_INLINE void orient(bool both_sides) {
        const DI di;
        const DF df;
        const VI zero = hn::Zero(di);
        const VI signed_area = hn::Sub(hn::Mul(hn::Sub(x[1], x[0]), hn::Sub(y[2], y[0])),
                                       hn::Mul(hn::Sub(y[1], y[0]), hn::Sub(x[2], x[0])));
        const MI front = hn::Lt(signed_area, zero);
        drawn = hn::And(drawn, both_sides ? hn::Ne(signed_area, zero) : front);
        area = hn::Abs(signed_area);
        swapIf(front, x[1], x[2]);
        swapIf(front, y[1], y[2]);
        const auto front_f = hn::RebindMask(df, front);
        const VF old = depth[1];
        depth[1] = hn::IfThenElse(front_f, depth[2], old);
        depth[2] = hn::IfThenElse(front_f, old, depth[2]);
    }

private:
    HWY_INLINE static void swapIf(MI mask, VI& a, VI& b) {
        const VI old = a;
        a = hn::IfThenElse(mask, b, old);
        b = hn::IfThenElse(mask, old, b);
    }
};

/// One triangle taken out of its lane, for the row loop.
struct SmallTriangle {
    int32_t x[3], y[3];
    float depth[3];
    int32_t area;
    uint32_t low;
};

template <int kSamples>
class Kernel {
public:
    HWY_INLINE Kernel(const VisibilityTile& tile, const TriangleRun& run,
                      std::vector<uint32_t>& clipped)
        : tile_(tile), run_(run), clipped_(clipped), offset_(sampleOffsets(kSamples)) {}

    /// Corners are copied side by side one group ahead, so that the stores have left the pipeline
    /// when they are read as vectors: faster than gathering.
    HWY_INLINE void drawAll() {
        const size_t lanes = hn::Lanes(DI());
        HWY_ALIGN ScreenVertex corner[2][3][kMaxLanes];
        if (run_.count == 0) return;
        stage(0, lanes, corner[0]);
        for (size_t first = 0, turn = 0; first < run_.count; first += lanes, turn ^= 1) {
            if (first + lanes < run_.count) stage(first + lanes, lanes, corner[turn ^ 1]);
            drawGroup(corner[turn], first, std::min(lanes, run_.count - first));
        }
    }

private:
    HWY_INLINE void stage(size_t first, size_t lanes, ScreenVertex (*corner)[kMaxLanes]) const {
        const size_t count = std::min(lanes, run_.count - first);
        for (size_t i = 0; i < count; ++i)
            for (size_t k = 0; k < 3; ++k) corner[k][i] = run_.vertex[run_.triangle[first + i][k]];
        // Filled up with equal corners: no area.
        for (size_t i = count; i < lanes; ++i)
            for (size_t k = 0; k < 3; ++k) corner[k][i] = corner[0][0];
    }

    HWY_INLINE void drawGroup(const ScreenVertex (*corner)[kMaxLanes], size_t first, size_t count) {
        const DI di;
        const DU du;
        const DF df;
        Group g;
        for (int k = 0; k < 3; ++k) {
            VI depth, unused;
            hn::LoadInterleaved4(di, reinterpret_cast<const int32_t*>(corner[k]), g.x[k], g.y[k],
                                 depth, unused);
            g.depth[k] = hn::BitCast(df, depth);
        }
        g.min_x = hn::Min(g.x[0], hn::Min(g.x[1], g.x[2]));
        g.min_y = hn::Min(g.y[0], hn::Min(g.y[1], g.y[2]));
        g.max_x = hn::Max(g.x[0], hn::Max(g.x[1], g.x[2]));
        g.max_y = hn::Max(g.y[0], hn::Max(g.y[1], g.y[2]));
        const MI whole = hn::Ne(g.min_x, hn::Set(di, kNoImage));
        if (HWY_UNLIKELY(!hn::AllTrue(di, whole))) clipLanes(whole, g, first, count);

        // What misses all samples of the tile, and what is too large for 32 bits.
        const MI touched = hn::And(whole, touchesTile(g));
        if (hn::AllFalse(di, touched)) return;
        const VI limit = hn::Set(di, kSmallExtent + 1);
        const MI small = hn::And(hn::Lt(hn::Sub(g.max_x, g.min_x), limit),
                                 hn::Lt(hn::Sub(g.max_y, g.min_y), limit));
        const MI large = hn::AndNot(small, touched);
        if (HWY_UNLIKELY(!hn::AllFalse(di, large))) drawLarge(bitsOf(di, large), corner, first);

        g.drawn = hn::And(small, touched);
        const VU number = hn::Iota(du, run_.first_number + uint32_t(first));
        g.low = hn::BitCast(di, hn::Sub(hn::Set(du, lowerWord(0)), number));
        g.orient(run_.both_sides);
        for (int sample = 0; sample < kSamples; ++sample) drawSample(g, sample);
    }

    /// Conservative: some pixel of the tile may have a sample within the triangle's box.
    HWY_INLINE MI touchesTile(const Group& g) const {
        const DI di;
        const PixelBox& box = tile_.box;
        const auto edge = [&](int32_t pixel) { return hn::Set(di, pixel * kSubpixel); };
        return hn::And(hn::And(hn::Gt(g.max_x, edge(box.x0)), hn::Lt(g.min_x, edge(box.x1))),
                       hn::And(hn::Gt(g.max_y, edge(box.y0)), hn::Lt(g.min_y, edge(box.y1))));
    }

    void clipLanes(MI whole, const Group& g, size_t first, size_t count) {
        const DI di;
        // All three behind: none has an image, and kBehind is the least of the reasons.
        const MI behind =
            hn::And(hn::Eq(g.max_x, hn::Set(di, kNoImage)), hn::Eq(g.max_y, hn::Set(di, kBehind)));
        uint32_t bits = bitsOf(di, hn::Not(hn::Or(whole, behind)));
        for (; bits != 0; bits &= bits - 1) {
            const auto lane = size_t(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
            if (lane < count) clipped_.push_back(uint32_t(first + lane));
        }
    }

    void drawLarge(uint32_t bits, const ScreenVertex (*corner)[kMaxLanes], size_t first) const {
        for (; bits != 0; bits &= bits - 1) {
            const auto lane = size_t(hwy::Num0BitsBelowLS1Bit_Nonzero32(bits));
            std::array<ScreenPoint, 3> point;
            for (size_t k = 0; k < 3; ++k) {
                const ScreenVertex& v = corner[k][lane];
                point[k] = {v.x, v.y, v.inv_depth};
            }
            drawTriangle(tile_, point, run_.both_sides, run_.first_number + uint32_t(first + lane));
        }
    }

    HWY_INLINE void drawSample(const Group& g, int sample) const {
        const DI di;
        const SampleOffset at = offset_[sample];
        const VI before_x = hn::Set(di, kHalfPixel + at.x),
                 before_y = hn::Set(di, kHalfPixel + at.y);
        const VI round_up = hn::Set(di, kSubpixel - 1);
        const auto first = [&](VI low, VI before, int32_t box_low) {
            const VI pixel = hn::ShiftRight<kSubpixelBits>(hn::Add(hn::Sub(low, before), round_up));
            return hn::Max(pixel, hn::Set(di, box_low));
        };
        const auto last = [&](VI high, VI before, int32_t box_high) {
            const VI pixel = hn::ShiftRight<kSubpixelBits>(hn::Sub(high, before));
            return hn::Min(pixel, hn::Set(di, box_high - 1));
        };
        const VI x0 = first(g.min_x, before_x, tile_.box.x0),
                 x1 = last(g.max_x, before_x, tile_.box.x1);
        const VI y0 = first(g.min_y, before_y, tile_.box.y0),
                 y1 = last(g.max_y, before_y, tile_.box.y1);
        const VI wide = hn::Sub(x1, x0), high = hn::Sub(y1, y0), one = hn::Set(di, 1);
        const MI hit = hn::And(g.drawn, hn::Gt(hn::Min(wide, high), hn::Set(di, -1)));
        if (hn::AllFalse(di, hit)) return;
        const MI tiny = hn::And(hit, hn::Lt(hn::Max(wide, high), hn::Set(di, 2)));
        drawTiny(g, tiny, x0, y0, hn::Eq(wide, one), hn::Eq(high, one), sample);
        const MI more = hn::AndNot(tiny, hit);
        if (!hn::AllFalse(di, more)) drawRows(g, bitsOf(di, more), x0, x1, y0, y1, sample);
    }

    /// At most 2 x 2 pixels from (x0, y0); `two_x`, `two_y`: two columns, two rows.
    HWY_INLINE void drawTiny(const Group& g, MI tiny, VI x0, VI y0, MI two_x, MI two_y,
                             int sample) const {
        const DI di;
        const DF df;
        const SampleOffset at = offset_[sample];
        VI x[3], y[3];
        for (int k = 0; k < 3; ++k) {
            x[k] = hn::Sub(
                g.x[k], hn::Add(hn::ShiftLeft<kSubpixelBits>(x0), hn::Set(di, kHalfPixel + at.x)));
            y[k] = hn::Sub(
                g.y[k], hn::Add(hn::ShiftLeft<kSubpixelBits>(y0), hn::Set(di, kHalfPixel + at.y)));
        }
        const LaneEdge edge[3] = {
            {x[1], y[1], x[2], y[2]}, {x[2], y[2], x[0], y[0]}, {x[0], y[0], x[1], y[1]}};
        VI value[3];
        for (int k = 0; k < 3; ++k)
            value[k] = edge[k].valueAtOrigin(x[(k + 1) % 3], y[(k + 1) % 3]);
        const VF inv_area = hn::Div(hn::Set(df, 1.0f), hn::ConvertTo(df, g.area));
        const VF d1 = hn::Sub(g.depth[1], g.depth[0]), d2 = hn::Sub(g.depth[2], g.depth[0]);
        const VF nearest = hn::Max(g.depth[0], hn::Max(g.depth[1], g.depth[2]));
        const VF farthest = hn::Min(g.depth[0], hn::Min(g.depth[1], g.depth[2]));

        HWY_ALIGN int32_t low[kMaxLanes], pixel[kMaxLanes], depth[kMaxLanes];
        hn::Store(g.low, di, low);
        hn::Store(hn::Add(hn::Mul(y0, hn::Set(di, tile_.width)), x0), di, pixel);
        const auto tryPixel = [&](MI lanes, const VI e[3], ptrdiff_t offset) HWY_ATTR {
            const VI sign = hn::Or(hn::Or(hn::Add(e[0], edge[0].bias), hn::Add(e[1], edge[1].bias)),
                                   hn::Add(e[2], edge[2].bias));
            const MI inside = hn::And(lanes, hn::Gt(sign, hn::Set(di, -1)));
            uint32_t bits = bitsOf(di, inside);
            if (bits == 0) return;
            const VF sum =
                hn::Add(hn::Mul(hn::ConvertTo(df, e[1]), d1), hn::Mul(hn::ConvertTo(df, e[2]), d2));
            const VF inv_depth = hn::Add(g.depth[0], hn::Mul(sum, inv_area));
            hn::Store(hn::BitCast(di, hn::Min(hn::Max(inv_depth, farthest), nearest)), di, depth);
            for (; bits != 0; bits &= bits - 1) {
                const auto lane = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
                put(keyAt(pixel[lane] + offset, sample), depth[lane], uint32_t(low[lane]));
            }
        };
        tryPixel(tiny, value, 0);
        const auto moved = [&](const VI e[3], bool down, VI out[3]) HWY_ATTR {
            for (int k = 0; k < 3; ++k)
                out[k] = down ? hn::Add(e[k], hn::ShiftLeft<kSubpixelBits>(edge[k].dx))
                              : hn::Sub(e[k], hn::ShiftLeft<kSubpixelBits>(edge[k].dy));
        };
        VI right[3], down[3];
        moved(value, false, right);
        tryPixel(hn::And(tiny, two_x), right, 1);
        const MI lower = hn::And(tiny, two_y);
        moved(value, true, down);
        tryPixel(lower, down, tile_.width);
        moved(right, true, down);
        tryPixel(hn::And(lower, two_x), down, tile_.width + 1);
    }

    HWY_INLINE VisibilityKey* keyAt(ptrdiff_t pixel, int sample) const {
        return tile_.key + pixel * kSamples + sample;
    }

    void drawRows(const Group& g, uint32_t bits, VI x0, VI x1, VI y0, VI y1, int sample) const {
        const DI di;
        const DF df;
        HWY_ALIGN int32_t x[3][kMaxLanes], y[3][kMaxLanes], area[kMaxLanes], low[kMaxLanes];
        HWY_ALIGN int32_t left[kMaxLanes], right[kMaxLanes], top[kMaxLanes], bottom[kMaxLanes];
        HWY_ALIGN float depth[3][kMaxLanes];
        for (int k = 0; k < 3; ++k) {
            hn::Store(g.x[k], di, x[k]);
            hn::Store(g.y[k], di, y[k]);
            hn::Store(g.depth[k], df, depth[k]);
        }
        hn::Store(g.area, di, area);
        hn::Store(g.low, di, low);
        hn::Store(x0, di, left);
        hn::Store(x1, di, right);
        hn::Store(y0, di, top);
        hn::Store(y1, di, bottom);
        for (; bits != 0; bits &= bits - 1) {
            const auto i = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
            SmallTriangle t{{x[0][i], x[1][i], x[2][i]},
                            {y[0][i], y[1][i], y[2][i]},
                            {depth[0][i], depth[1][i], depth[2][i]},
                            area[i],
                            uint32_t(low[i])};
            drawSmall(t, {left[i], top[i], right[i] + 1, bottom[i] + 1}, sample);
        }
    }

    /// Row by row, eight pixels at a time.
    HWY_INLINE void drawSmall(const SmallTriangle& t, const PixelBox& box, int sample) const {
        const RI ri;
        const RF rf;
        const int lanes = int(hn::Lanes(ri));
        const SampleOffset at = offset_[sample];
        const int32_t origin_x = box.x0 * kSubpixel + kHalfPixel + at.x;
        const int32_t origin_y = box.y0 * kSubpixel + kHalfPixel + at.y;
        int32_t row[3], bias[3], step_x[3], step_y[3];
        for (int k = 0; k < 3; ++k) {
            const int a = (k + 1) % 3, b = (k + 2) % 3;
            const int32_t dx = t.x[b] - t.x[a], dy = t.y[b] - t.y[a];
            row[k] = dy * (t.x[a] - origin_x) - dx * (t.y[a] - origin_y);
            bias[k] = dy < 0 || (dy == 0 && dx > 0) ? 0 : -1;
            step_x[k] = -dy * kSubpixel;
            step_y[k] = dx * kSubpixel;
        }
        const auto d0 = hn::Set(rf, t.depth[0]);
        const auto d1 = hn::Set(rf, t.depth[1] - t.depth[0]),
                   d2 = hn::Set(rf, t.depth[2] - t.depth[0]);
        const auto nearest = hn::Set(rf, std::max({t.depth[0], t.depth[1], t.depth[2]}));
        const auto farthest = hn::Set(rf, std::min({t.depth[0], t.depth[1], t.depth[2]}));
        const auto inv_area = hn::Set(rf, 1.0f / float(t.area));
        const auto iota = hn::Iota(ri, 0);
        HWY_ALIGN int32_t depth[8];
        for (int32_t y = box.y0; y < box.y1; ++y) {
            for (int32_t x = box.x0; x < box.x1; x += lanes) {
                hn::Vec<RI> e[3];
                for (int k = 0; k < 3; ++k)
                    e[k] = hn::Add(hn::Set(ri, row[k] + (x - box.x0) * step_x[k]),
                                   hn::Mul(hn::Set(ri, step_x[k]), iota));
                const auto sign = hn::Or(hn::Or(hn::Add(e[0], hn::Set(ri, bias[0])),
                                                hn::Add(e[1], hn::Set(ri, bias[1]))),
                                         hn::Add(e[2], hn::Set(ri, bias[2])));
                const auto inside =
                    hn::And(hn::Gt(sign, hn::Set(ri, -1)), hn::Lt(iota, hn::Set(ri, box.x1 - x)));
                uint32_t bits = bitsOf(ri, inside);
                if (bits == 0) continue;
                const auto sum = hn::Add(hn::Mul(hn::ConvertTo(rf, e[1]), d1),
                                         hn::Mul(hn::ConvertTo(rf, e[2]), d2));
                const auto inv_depth = hn::Add(d0, hn::Mul(sum, inv_area));
                hn::Store(hn::BitCast(ri, hn::Min(hn::Max(inv_depth, farthest), nearest)), ri,
                          depth);
                VisibilityKey* key = keyAt(ptrdiff_t(y) * tile_.width + x, sample);
                for (; bits != 0; bits &= bits - 1) {
                    const auto lane = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
                    put(key + lane * size_t(kSamples), depth[lane], t.low);
                }
            }
            for (int k = 0; k < 3; ++k) row[k] += step_y[k];
        }
    }

    const VisibilityTile tile_;
    const TriangleRun& run_;
    std::vector<uint32_t>& clipped_;
    const SampleOffset* offset_;
};

void DrawTriangles(const VisibilityTile& tile, const TriangleRun& run,
                   std::vector<uint32_t>& clipped) {
    if (tile.samples == 1)
        Kernel<1>(tile, run, clipped).drawAll();
    else
        Kernel<4>(tile, run, clipped).drawAll();
}

}  // namespace HWY_NAMESPACE
}  // namespace pietra
HWY_AFTER_NAMESPACE();

#if HWY_ONCE
namespace pietra {

HWY_EXPORT(DrawTriangles);

void drawTriangles(const VisibilityTile& tile, const TriangleRun& run,
                   std::vector<uint32_t>& clipped) {
    HWY_DYNAMIC_DISPATCH(DrawTriangles)(tile, run, clipped);
}

}  // namespace pietra
#endif
