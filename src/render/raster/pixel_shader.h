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
    uint32_t number;  ///< of the triangle, in the batch
    uint16_t x, y;
    uint32_t target;  ///< the caller's
};

class PixelShader {
public:
    /// All three must outlive this.
    PixelShader(const View& view, const Projection& projection, const ShadeSettings& settings);

    /// `colour` takes one sRGB colour an item. At most kShadeLanes items.
    void shade(const Batch& batch, std::span<const ShadeItem> items, Rgba8* colour) const;

private:
    struct Source;
    void gather(const Batch& batch, const ShadeItem& item, size_t lane, Source& source,
                ShadeLanes& lanes) const;
    void giveWeights(const Source& source, const ShadeItem& item, size_t lane,
                     ShadeLanes& lanes) const;
    Vec3f baseColour(const Source& source, size_t lane, const ShadeLanes& lanes) const;

    const Projection& projection_;
    const ShadeSettings& settings_;
    ShadeView view_;
    bool base_is_patch_;  ///< no colour comes from vertices or triangles
};

}  // namespace pietra
