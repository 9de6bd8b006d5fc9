#pragma once
// The colours of visible pixels. Attributes are interpolated by perspective-correct barycentric
// coordinates at the pixel's centre, or near the closest point of the triangle where a sample but
// not the centre is covered: they depend on triangle and pixel alone, not on what else is visible
// there, nor on which pixels are shaded together.

#include <algorithm>
#include <bit>
#include <span>

#include "render/raster/batch.h"
#include "render/raster/shade_kernel.h"
#include "render/shading.h"

namespace pietra {

/// One triangle in one pixel.
struct ShadeItem {
    uint32_t triangle;  ///< of the patch
    uint32_t place;  ///< of the pixel, and which samples: x, y and mask, from the low bits upwards

    static ShadeItem at(uint32_t triangle, int32_t x, int32_t y, uint32_t sample_mask) {
        return {triangle,
                uint32_t(x) | uint32_t(y) << kPlaceBits | sample_mask << (2 * kPlaceBits)};
    }
    int32_t x() const { return int32_t(place & kPlaceMask); }
    int32_t y() const { return int32_t(place >> kPlaceBits & kPlaceMask); }
    uint32_t sampleMask() const { return place >> (2 * kPlaceBits); }
};

class PixelShader {
public:
    /// All three must outlive this.
    PixelShader(const View& view, const Projection& projection, const ShadeSettings& settings);

    /// `put(i, colour)` is called for each item with its sRGB colour, in order.
    template <class Put>
    void shade(const BatchPatch& patch, std::span<const ShadeItem> items, const Put& put) const {
        // Gathered one vector ahead, so that the stores have left the pipeline when the kernel
        // loads them.
        ShadeLanes lanes[2];
        if (items.empty()) return;
        for (ShadeLanes& l : lanes) prepare(patch, l);
        gather(patch, items, lanes[0]);
        for (size_t done = 0, turn = 0; done < items.size(); done += kShadeLanes, turn ^= 1) {
            if (done + kShadeLanes < items.size())
                gather(patch, items.subspan(done + kShadeLanes), lanes[turn ^ 1]);
            compute(patch, items.subspan(done), lanes[turn]);
            const size_t count = std::min(size_t(kShadeLanes), items.size() - done);
            for (size_t i = 0; i < count; ++i) put(done + i, colour(lanes[turn], i));
        }
    }

private:
    /// What is the same for all items of a patch.
    void prepare(const BatchPatch& patch, ShadeLanes& lanes) const;
    /// The first kShadeLanes of `items`, or less, the last one then taken for those that lack.
    void gather(const BatchPatch& patch, std::span<const ShadeItem> items, ShadeLanes& lanes) const;
    void compute(const BatchPatch& patch, std::span<const ShadeItem> items,
                 ShadeLanes& lanes) const;
    void giveWeights(const BatchPatch& patch, const ShadeItem& item, size_t lane,
                     ShadeLanes& lanes) const;
    Vec3f baseColour(const BatchPatch& patch, uint32_t triangle, const Vec3f& weight) const;
    float edgeLine(const ShadeLanes& lanes, size_t i) const;
    Rgba8 colour(const ShadeLanes& lanes, size_t i) const {
        const uint32_t bytes = bytes_[lanes.lit[0][i]] | uint32_t(bytes_[lanes.lit[1][i]]) << 8 |
                               uint32_t(bytes_[lanes.lit[2][i]]) << 16 | 0xff000000u;
        return std::bit_cast<Rgba8>(bytes);
    }
    bool baseIsPatchColour(const BatchPatch& patch) const;

    const Projection& projection_;
    const ShadeSettings& settings_;
    ShadeView view_;
    const uint8_t* bytes_;  ///< of ShadeLanes::lit
};

}  // namespace pietra
