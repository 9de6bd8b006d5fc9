#pragma once
// The arithmetic of shading, for as many pixels at a time as a SIMD register has lanes. Gathering
// what a pixel needs from patches, and what is rare, is PixelShader's; here are two steps over
// arrays of at most kShadeLanes pixels, with the same bits for any number of lanes.

#include <cstdint>

#include "render/raster/projection.h"

namespace pietra {

/// Pixels shaded together, whatever the SIMD level.
inline constexpr int kShadeLanes = 16;

/// Pictures have at most 2^kPlaceBits columns and rows.
inline constexpr int kPlaceBits = 14;
inline constexpr int32_t kPlaceMask = (1 << kPlaceBits) - 1;

struct alignas(64) ShadeLanes {
    // Set by the caller.
    ScreenVertex corner[3][kShadeLanes];
    int32_t place[kShadeLanes];  ///< of the pixel: x, y * 2^kPlaceBits, and bits that do not matter
                                 ///< here
    /// Where `given` is -1 a corner has no image, and perspective-correct weights (of any sum but
    /// 0) and facing are the caller's.
    int32_t given[kShadeLanes], given_back[kShadeLanes];
    float given_weight[3][kShadeLanes];
    // Set by interpolateLanes().
    float weight[3][kShadeLanes];  ///< barycentric, not negative, sum 1
    float normal[3][kShadeLanes];  ///< in view space, unit length, towards the eye
    float to_eye[3][kShadeLanes];  ///< in view space, unit length
    // Set by the caller for lightLanes().
    float base[3][kShadeLanes];  ///< surface colour in linear light
    // Set by lightLanes().
    int32_t lit[3][kShadeLanes];  ///< entries of srgbTable(), or of plainTable()
    // Set by the caller; last, as all arrays are aligned.
    bool both_sides;  ///< of the patch
    bool any_given;   ///< some lanes of `given` are set
};

struct ShadeView {
    Vec3f right, up, back;     ///< axes of the view, in lattice space
    float centre_x, centre_y;  ///< of the picture, in pixels
    float inv_focal;           ///< 1 / pixels
    Vec3f light;               ///< towards the light, in view space, unit length
};

void interpolateLanes(const ShadeView& view, ShadeLanes& lanes);
/// `lit` from `base`, by the light or as it is.
void lightLanes(const ShadeView& view, ShadeLanes& lanes);
void leaveUnlit(ShadeLanes& lanes);
/// `lit` from `normal`, components from -1 to 1 over the whole of plainTable().
void showNormals(ShadeLanes& lanes);

}  // namespace pietra
