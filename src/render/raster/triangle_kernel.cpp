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

/// What one sample position shares: coordinates from that sample of the pixel (x0, y0) of each
/// lane.
struct Sampled {
    VI wide, high;  ///< how many pixels there are within triangle and tile, beside the first
    LaneEdge edge[3];
    VI value[3];    ///< of the edges, at the origin
    VF d0, d1, d2;  ///< depth and its differences
    VF inv_area, nearest, farthest;
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
        const VI wide = hn::Sub(x1, x0), high = hn::Sub(y1, y0);
        const MI hit = hn::And(g.drawn, hn::Gt(hn::Min(wide, high), hn::Set(di, -1)));
        if (hn::AllFalse(di, hit)) return;
        const MI tiny = hn::And(hit, hn::Lt(hn::Max(wide, high), hn::Set(di, 2)));
        const Sampled s = sampled(g, x0, y0, wide, high, at);
        HWY_ALIGN int32_t low[kMaxLanes], pixel[kMaxLanes];
        hn::Store(g.low, di, low);
        const VI in_row = hn::Sub(x0, hn::Set(di, tile_.origin));
        hn::Store(hn::Add(hn::Mul(y0, hn::Set(di, tile_.width)), in_row), di, pixel);
        if (!hn::AllFalse(di, tiny)) drawTiny(s, tiny, low, pixel, sample);
        const uint32_t more = bitsOf(di, hn::AndNot(tiny, hit));
        if (more != 0) drawBlocks(s, more, low, pixel, sample);
    }

    HWY_INLINE static Sampled sampled(const Group& g, VI x0, VI y0, VI wide, VI high,
                                      SampleOffset at) {
        const DI di;
        const DF df;
        const VI origin_x =
            hn::Add(hn::ShiftLeft<kSubpixelBits>(x0), hn::Set(di, kHalfPixel + at.x));
        const VI origin_y =
            hn::Add(hn::ShiftLeft<kSubpixelBits>(y0), hn::Set(di, kHalfPixel + at.y));
        VI x[3], y[3];
        for (int k = 0; k < 3; ++k) {
            x[k] = hn::Sub(g.x[k], origin_x);
            y[k] = hn::Sub(g.y[k], origin_y);
        }
        const LaneEdge edge[3] = {
            {x[1], y[1], x[2], y[2]}, {x[2], y[2], x[0], y[0]}, {x[0], y[0], x[1], y[1]}};
        return {wide,
                high,
                {edge[0], edge[1], edge[2]},
                {edge[0].valueAtOrigin(x[1], y[1]), edge[1].valueAtOrigin(x[2], y[2]),
                 edge[2].valueAtOrigin(x[0], y[0])},
                g.depth[0],
                hn::Sub(g.depth[1], g.depth[0]),
                hn::Sub(g.depth[2], g.depth[0]),
                hn::Div(hn::Set(df, 1.0f), hn::ConvertTo(df, g.area)),
                hn::Max(g.depth[0], hn::Max(g.depth[1], g.depth[2])),
                hn::Min(g.depth[0], hn::Min(g.depth[1], g.depth[2]))};
    }

    /// At most 2 x 2 pixels each, a triangle a lane.
    HWY_INLINE void drawTiny(const Sampled& s, MI tiny, const int32_t* low, const int32_t* pixel,
                             int sample) const {
        const DI di;
        const DF df;
        HWY_ALIGN int32_t depth[kMaxLanes];
        const auto tryPixel = [&](MI lanes, const VI e[3], ptrdiff_t offset) HWY_ATTR {
            const VI sign =
                hn::Or(hn::Or(hn::Add(e[0], s.edge[0].bias), hn::Add(e[1], s.edge[1].bias)),
                       hn::Add(e[2], s.edge[2].bias));
            const MI inside = hn::And(lanes, hn::Gt(sign, hn::Set(di, -1)));
            uint32_t bits = bitsOf(di, inside);
            if (bits == 0) return;
            const VF sum = hn::Add(hn::Mul(hn::ConvertTo(df, e[1]), s.d1),
                                   hn::Mul(hn::ConvertTo(df, e[2]), s.d2));
            const VF inv_depth = hn::Add(s.d0, hn::Mul(sum, s.inv_area));
            hn::Store(hn::BitCast(di, hn::Min(hn::Max(inv_depth, s.farthest), s.nearest)), di,
                      depth);
            for (; bits != 0; bits &= bits - 1) {
                const auto lane = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
                put(keyAt(pixel[lane] + offset, sample), depth[lane], uint32_t(low[lane]));
            }
        };
        const auto moved = [&](const VI e[3], bool down, VI out[3]) HWY_ATTR {
            for (int k = 0; k < 3; ++k)
                out[k] = down ? hn::Add(e[k], hn::ShiftLeft<kSubpixelBits>(s.edge[k].dx))
                              : hn::Sub(e[k], hn::ShiftLeft<kSubpixelBits>(s.edge[k].dy));
        };
        const MI two_x = hn::And(tiny, hn::Eq(s.wide, hn::Set(di, 1)));
        const MI two_y = hn::And(tiny, hn::Eq(s.high, hn::Set(di, 1)));
        VI right[3], down[3];
        tryPixel(tiny, s.value, 0);
        moved(s.value, false, right);
        tryPixel(two_x, right, 1);
        moved(s.value, true, down);
        tryPixel(two_y, down, tile_.width);
        moved(right, true, down);
        tryPixel(hn::And(two_x, two_y), down, tile_.width + 1);
    }

    HWY_INLINE VisibilityKey* keyAt(ptrdiff_t pixel, int sample) const {
        return tile_.key + pixel * kSamples + sample;
    }

    /// Larger ones, one after the other: blocks of four columns and as many rows as there are
    /// lanes.
    void drawBlocks(const Sampled& s, uint32_t bits, const int32_t* low, const int32_t* pixel,
                    int sample) const {
        const DI di;
        const DF df;
        HWY_ALIGN int32_t value[3][kMaxLanes], bias[3][kMaxLanes], step_x[3][kMaxLanes],
            step_y[3][kMaxLanes], wide[kMaxLanes], high[kMaxLanes];
        HWY_ALIGN float d0[kMaxLanes], d1[kMaxLanes], d2[kMaxLanes], inv_area[kMaxLanes],
            nearest[kMaxLanes], farthest[kMaxLanes];
        for (int k = 0; k < 3; ++k) {
            hn::Store(s.value[k], di, value[k]);
            hn::Store(s.edge[k].bias, di, bias[k]);
            hn::Store(hn::Neg(hn::ShiftLeft<kSubpixelBits>(s.edge[k].dy)), di, step_x[k]);
            hn::Store(hn::ShiftLeft<kSubpixelBits>(s.edge[k].dx), di, step_y[k]);
        }
        hn::Store(s.wide, di, wide);
        hn::Store(s.high, di, high);
        hn::Store(s.d0, df, d0);
        hn::Store(s.d1, df, d1);
        hn::Store(s.d2, df, d2);
        hn::Store(s.inv_area, df, inv_area);
        hn::Store(s.nearest, df, nearest);
        hn::Store(s.farthest, df, farthest);

        const int columns = int(std::min(hn::Lanes(di), size_t(4)));
        const int rows = int(hn::Lanes(di)) / columns;
        const VI column = hn::And(hn::Iota(di, 0), hn::Set(di, 3));
        const VI row = hn::ShiftRight<2>(hn::Iota(di, 0));
        HWY_ALIGN int32_t place[kMaxLanes], depth[kMaxLanes];
        hn::Store(hn::Add(hn::Mul(row, hn::Set(di, tile_.width)), column), di, place);
        for (; bits != 0; bits &= bits - 1) {
            const auto i = hwy::Num0BitsBelowLS1Bit_Nonzero32(bits);
            VI across[3], base[3];
            for (int k = 0; k < 3; ++k) {
                across[k] = hn::Mul(hn::Set(di, step_x[k][i]), column);
                base[k] = hn::Add(hn::Add(hn::Set(di, value[k][i]), across[k]),
                                  hn::Mul(hn::Set(di, step_y[k][i]), row));
            }
            for (int y = 0; y <= high[i]; y += rows) {
                const MI in_height = hn::Lt(row, hn::Set(di, high[i] + 1 - y));
                for (int x = 0; x <= wide[i]; x += columns) {
                    VI e[3];
                    for (int k = 0; k < 3; ++k)
                        e[k] = hn::Add(base[k], hn::Set(di, x * step_x[k][i] + y * step_y[k][i]));
                    const VI sign = hn::Or(hn::Or(hn::Add(e[0], hn::Set(di, bias[0][i])),
                                                  hn::Add(e[1], hn::Set(di, bias[1][i]))),
                                           hn::Add(e[2], hn::Set(di, bias[2][i])));
                    const MI in_width = hn::Lt(column, hn::Set(di, wide[i] + 1 - x));
                    uint32_t inside = bitsOf(
                        di, hn::And(hn::And(in_height, in_width), hn::Gt(sign, hn::Set(di, -1))));
                    if (inside == 0) continue;
                    const VF sum = hn::Add(hn::Mul(hn::ConvertTo(df, e[1]), hn::Set(df, d1[i])),
                                           hn::Mul(hn::ConvertTo(df, e[2]), hn::Set(df, d2[i])));
                    const VF inv_depth =
                        hn::Add(hn::Set(df, d0[i]), hn::Mul(sum, hn::Set(df, inv_area[i])));
                    hn::Store(hn::BitCast(di, hn::Min(hn::Max(inv_depth, hn::Set(df, farthest[i])),
                                                      hn::Set(df, nearest[i]))),
                              di, depth);
                    VisibilityKey* key = keyAt(pixel[i] + ptrdiff_t(y) * tile_.width + x, sample);
                    for (; inside != 0; inside &= inside - 1) {
                        const auto lane = hwy::Num0BitsBelowLS1Bit_Nonzero32(inside);
                        put(key + place[lane] * kSamples, depth[lane], uint32_t(low[i]));
                    }
                }
            }
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
