#pragma once
// The colour of one pixel of one triangle. Attributes are interpolated by perspective-correct
// barycentric coordinates at the pixel's centre, or at the nearest point of the triangle where a
// sample but not the centre is covered: they depend on triangle and pixel alone, not on what else
// is visible there.

#include "render/raster/batch.h"
#include "render/shading.h"

namespace pietra {

class PixelShader {
public:
    PixelShader(const View& view, const Projection& projection, const ShadeSettings& settings);
    Rgba8 shade(const Batch& batch, uint32_t number, int32_t x, int32_t y) const;

private:
    struct Corners;
    Vec3f barycentric(const Corners& corners, int32_t x, int32_t y, bool& back) const;
    Vec3f light(const Vec3f& base, const Vec3f& normal, const Vec3f& to_eye) const;
    Vec3f baseColour(const Batch& batch, const Corners& corners, const Vec3f& weight) const;

    const Projection& projection_;
    const ShadeSettings& settings_;
    Vec3f right_, up_, back_;
    float centre_x_, centre_y_, inv_focal_;
    Vec3f light_;
};

}  // namespace pietra
