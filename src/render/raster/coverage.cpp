#include "render/raster/coverage.h"

#include <algorithm>

namespace pietra {
namespace {

/// The directed line from a to b: value(p) = cross(b - a, p - a) is positive to its right hand (y
/// points down), where a positively oriented triangle lies.
struct Edge {
    int64_t dx, dy;
    int64_t ax, ay;
    int64_t bias;  // 0 for a top or left edge, else -1

    Edge(const ScreenPoint& a, const ScreenPoint& b)
        : dx(int64_t(b.x) - a.x),
          dy(int64_t(b.y) - a.y),
          ax(a.x),
          ay(a.y),
          bias(dy < 0 || (dy == 0 && dx > 0) ? 0 : -1) {}
    int64_t value(int64_t x, int64_t y) const { return dx * (y - ay) - dy * (x - ax); }
    int64_t perPixel() const { return -dy * kSubpixel; }
};

int64_t floorDivide(int64_t a, int64_t positive_b) {
    const int64_t q = a / positive_b;
    return q - (a % positive_b < 0);
}

/// Narrows [first, last], pixels counted from where the edge has `value`, to those inside.
void narrow(int64_t value, int64_t per_pixel, int64_t& first, int64_t& last) {
    if (per_pixel > 0)
        first = std::max(first, -floorDivide(value, per_pixel));
    else if (per_pixel < 0)
        last = std::min(last, floorDivide(value, -per_pixel));
    else if (value < 0)
        last = -1;
}

struct Depths {
    float d0, d1, d2, nearest, farthest;  // of the corners; the range
    explicit Depths(const std::array<ScreenPoint, 3>& c)
        : d0(c[0].inv_depth),
          d1(c[1].inv_depth),
          d2(c[2].inv_depth),
          nearest(std::max({c[0].inv_depth, c[1].inv_depth, c[2].inv_depth})),
          farthest(std::min({c[0].inv_depth, c[1].inv_depth, c[2].inv_depth})) {}
    /// Rounding must not carry a depth out of the triangle's range, or below zero.
    uint32_t bits(float inv_depth) const {
        return std::bit_cast<uint32_t>(std::min(std::max(inv_depth, farthest), nearest));
    }
};

struct Span {
    VisibilityKey* key;
    int64_t count;
    int stride;
    int64_t e1, e2;        // edge values at the first pixel
    int64_t step1, step2;  // and their steps
};

template <class Real>
void fillSpan(const Span& span, const Depths& depths, Real inv_area, uint32_t low) {
    int64_t e1 = span.e1, e2 = span.e2;
    // note: differences in float would lose what is far away of a triangle with a corner at the
    // eye.
    const Real d0 = depths.d0, d1 = Real(depths.d1) - d0, d2 = Real(depths.d2) - d0;
    VisibilityKey* key = span.key;
    for (int64_t i = 0; i < span.count; ++i, key += span.stride) {
        const Real sum = Real(e1) * d1 + Real(e2) * d2;
        const uint32_t bits = depths.bits(float(d0 + sum * inv_area));
        *key = std::max(*key, VisibilityKey(bits) << 32 | low);
        e1 += span.step1;
        e2 += span.step2;
    }
}

/// Pixels whose sample, `offset` from the centre, lies within [low, high] in 1/256 pixel.
int32_t firstPixel(int32_t low, int32_t offset) {
    return (low - kHalfPixel - offset + kSubpixel - 1) >> kSubpixelBits;
}
int32_t lastPixel(int32_t high, int32_t offset) {
    return (high - kHalfPixel - offset) >> kSubpixelBits;
}

void drawSample(const VisibilityTile& tile, const std::array<ScreenPoint, 3>& c, int64_t area,
                uint32_t number, int sample) {
    const auto [min_x, max_x] = std::minmax({c[0].x, c[1].x, c[2].x});
    const auto [min_y, max_y] = std::minmax({c[0].y, c[1].y, c[2].y});
    const SampleOffset at = sampleOffsets(tile.samples)[sample];
    const PixelBox box =
        tile.box.intersected({firstPixel(min_x, at.x), firstPixel(min_y, at.y),
                              lastPixel(max_x, at.x) + 1, lastPixel(max_y, at.y) + 1});
    if (box.empty()) return;
    const bool small = max_x - min_x <= kSmallExtent && max_y - min_y <= kSmallExtent;
    const Edge edge[3] = {{c[1], c[2]}, {c[2], c[0]}, {c[0], c[1]}};
    const Depths depths(c);
    const int64_t x = int64_t(box.x0) * kSubpixel + kHalfPixel + at.x;
    for (int32_t row = box.y0; row < box.y1; ++row) {
        const int64_t y = int64_t(row) * kSubpixel + kHalfPixel + at.y;
        int64_t first = 0, last = box.x1 - box.x0 - 1;
        for (const Edge& e : edge) narrow(e.value(x, y) + e.bias, e.perPixel(), first, last);
        if (first > last) continue;
        const int64_t start = x + first * kSubpixel;
        const size_t pixel = tile.at(int32_t(box.x0 + first), row);
        const Span span{tile.key + pixel * size_t(tile.samples) + size_t(sample),
                        last - first + 1,
                        tile.samples,
                        edge[1].value(start, y),
                        edge[2].value(start, y),
                        edge[1].perPixel(),
                        edge[2].perPixel()};
        if (small)
            fillSpan<float>(span, depths, 1.0f / float(area), lowerWord(number));
        else
            fillSpan<double>(span, depths, 1.0 / double(area), lowerWord(number));
    }
}

}  // namespace

void drawTriangle(const VisibilityTile& tile, std::array<ScreenPoint, 3> corner, bool both_sides,
                  uint32_t number) {
    int64_t area = Edge(corner[0], corner[1]).value(corner[2].x, corner[2].y);
    if (area == 0 || (area > 0 && !both_sides)) return;
    if (area < 0) {
        std::swap(corner[1], corner[2]);
        area = -area;
    }
    for (int sample = 0; sample < tile.samples; ++sample)
        drawSample(tile, corner, area, number, sample);
}

}  // namespace pietra
