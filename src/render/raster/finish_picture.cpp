#include "render/raster/finish_picture.h"

#include <algorithm>
#include <array>
#include <bit>
#include <limits>

#include "render/raster/resolve_kernel.h"

namespace pietra {
namespace {

constexpr float kNothing = std::numeric_limits<float>::infinity();

float depthOf(VisibilityKey key) {
    return 1 / std::bit_cast<float>(uint32_t(key >> 32));
}

/// Averages four sRGB colours in linear light, by tables of integers.
class Averager {
public:
    Rgba8 average(const Rgba8* c) const {
        return {average(c[0].r, c[1].r, c[2].r, c[3].r), average(c[0].g, c[1].g, c[2].g, c[3].g),
                average(c[0].b, c[1].b, c[2].b, c[3].b), 255};
    }

private:
    uint8_t average(uint8_t a, uint8_t b, uint8_t c, uint8_t d) const {
        static_assert(kLinearUnits == 8 * (kSrgbEntries - 1));
        const uint32_t sum = uint32_t(units_[a]) + units_[b] + units_[c] + units_[d];
        return srgb_[(sum + 16) >> 5];
    }
    const uint16_t* units_ = linearUnitTable();
    const uint8_t* srgb_ = srgbTable();
};

/// Of columns x & 3, from that of the first pixel of a row.
using Background = std::array<Rgba8, 4>;

void paint(const Background& background, Rgba8* colour, size_t width) {
    for (size_t x = 0; x < width; ++x) colour[x] = background[x & 3];
}

struct Row {
    VisibilityKey* key;
    const Rgba8* sample_colour;
    Rgba8* colour;
    float* depth;
    size_t width;
};

/// These return how many pixels are covered.
uint64_t finishRowOfOne(const Row& row, const Background& background) {
    // In place, the colours are there, but for the background.
    if (row.sample_colour == row.colour) {
        for (size_t x = 0; x < row.width; ++x)
            if (row.key[x] == 0) row.colour[x] = background[x & 3];
    } else {
        paint(background, row.colour, row.width);
    }
    const size_t covered =
        finishSamples(row.key, row.sample_colour, row.width, row.colour, row.depth);
    std::fill_n(row.key, row.width, VisibilityKey(0));
    return covered;
}

uint64_t finishRowOfFour(const Row& row, const Background& background, const Averager& averager) {
    uint64_t covered = 0;
    for (size_t x = 0; x < row.width; ++x) {
        VisibilityKey* key = row.key + 4 * x;
        const VisibilityKey nearest = std::max({key[0], key[1], key[2], key[3]});
        if (nearest == 0) {
            row.depth[x] = kNothing;
            row.colour[x] = background[x & 3];
            continue;
        }
        Rgba8 colour[4];
        for (size_t s = 0; s < 4; ++s)
            colour[s] = key[s] == 0 ? background[x & 3] : row.sample_colour[4 * x + s];
        row.depth[x] = depthOf(nearest);
        row.colour[x] = averager.average(colour);
        std::fill_n(key, 4, VisibilityKey(0));
        ++covered;
    }
    return covered;
}

Background backgroundFrom(const ShadeSettings& settings, const Picture& picture, int32_t x,
                          int32_t y) {
    Background background = backgroundRow(settings, y, picture.size.height);
    std::rotate(background.begin(), background.begin() + (x & 3), background.end());
    return background;
}

}  // namespace

uint64_t finishTile(const ShadeSettings& settings, const VisibilityTile& tile, Picture& picture) {
    const Averager averager;
    const auto samples = size_t(tile.samples);
    uint64_t covered = 0;
    for (int32_t y = tile.box.y0; y < tile.box.y1; ++y) {
        const Background background = backgroundFrom(settings, picture, tile.box.x0, y);
        const size_t from = tile.at(tile.box.x0, y) * samples, to = picture.index(tile.box.x0, y);
        const Row row{tile.key + from, tile.colour + from, picture.colour.data() + to,
                      picture.depth.data() + to, size_t(tile.box.x1 - tile.box.x0)};
        covered += samples == 1 ? finishRowOfOne(row, background)
                                : finishRowOfFour(row, background, averager);
    }
    return covered;
}

void finishEmpty(const ShadeSettings& settings, const PixelBox& box, Picture& picture) {
    for (int32_t y = box.y0; y < box.y1; ++y) {
        const Background background = backgroundFrom(settings, picture, box.x0, y);
        const size_t first = picture.index(box.x0, y), width = size_t(box.x1 - box.x0);
        paint(background, picture.colour.data() + first, width);
        std::fill_n(picture.depth.begin() + ptrdiff_t(first), width, kNothing);
    }
}

void paintDepth(Picture& picture) {
    float nearest = kNothing, farthest = 0;
    for (const float depth : picture.depth)
        if (depth != kNothing) {
            nearest = std::min(nearest, depth);
            farthest = std::max(farthest, depth);
        }
    const float scale = farthest > nearest ? 0.9f / (farthest - nearest) : 0;
    for (size_t i = 0; i < picture.pixelCount(); ++i) {
        const float depth = picture.depth[i];
        if (depth == kNothing) continue;
        const auto grey = uint8_t((1 - (depth - nearest) * scale) * 255 + 0.5f);
        picture.colour[i] = {grey, grey, grey, 255};
    }
}

}  // namespace pietra
