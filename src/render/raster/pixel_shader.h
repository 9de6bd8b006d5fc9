#pragma once
// The colours of visible pixels. Attributes are interpolated by perspective-correct barycentric
// coordinates at the pixel's centre, or near the closest point of the triangle where a sample but
// not the centre is covered: they depend on triangle and pixel alone, not on what else is visible
// there, nor on which pixels are shaded together.

#include <span>

#include "render/raster/batch.h"
#include "render/raster/shade_kernel.h"
#include "render/shading.h"

namespace pietra {

/// One triangle in one pixel.
struct ShadeItem {
    uint32_t triangle;  ///< of the patch
    uint16_t x, y;
    uint32_t target;  ///< the caller's own
};

class PixelShader {
public:
    /// All three must outlive this.
    PixelShader(const View& view, const Projection& projection, const ShadeSettings& settings);

    /// `colour` takes one sRGB colour an item. At least one item of the patch and at most
    /// kShadeLanes.
    void shade(const BatchPatch& patch, std::span<const ShadeItem> items, Rgba8* colour) const;

private:
    void gather(const BatchPatch& patch, const ShadeItem& item, size_t lane,
                ShadeLanes& lanes) const;
    void giveWeights(const BatchPatch& patch, const ShadeItem& item, size_t lane,
                     ShadeLanes& lanes) const;
    Vec3f baseColour(const BatchPatch& patch, uint32_t triangle, const Vec3f& weight) const;
    bool baseIsPatchColour(const BatchPatch& patch) const;

    const Projection& projection_;
    const ShadeSettings& settings_;
    ShadeView view_;
    const uint8_t* bytes_;  ///< of ShadeLanes::lit
};

}  // namespace pietra
