#pragma once
// What a pixel of a surface looks like: the settings all renderers share, the colours of the debug
// views, and the step between linear light and the sRGB bytes of a picture. Only +, -, *, / and
// sqrt, so that a picture's bytes are the same on every machine.

#include <algorithm>
#include <array>
#include <cstdint>

#include "geometry/mesh.h"
#include "geometry/vec.h"
#include "multires/draw_list.h"

namespace pietra {

/// The views of `render --show`.
enum class Show {
    kShaded,     ///< lit, in the vertex colours where there are any
    kNormals,    ///< the normal in view space, x y z as red green blue
    kDepth,      ///< near is light; the range is the picture's own
    kLod,        ///< lit, each patch in the colour of its level, DrawPatch::value
    kPatches,    ///< lit, each patch in a colour of its own
    kTriangles,  ///< lit, each triangle in a colour of its own
    kError,      ///< lit, DrawPatch::value from value_min (blue) to value_max (red)
    kColour,     ///< vertex colours, unlit
    kWire,       ///< as kShaded, with the triangles' edges as dark lines
    kScalar,     ///< lit, one scalar attribute in a colour map
};

struct ShadeSettings {
    Show show = Show::kShaded;
    /// Towards the one light, in view space: right, up, towards the viewer. Any length but zero.
    Vec3d light_direction{-0.6, 0.6, 0.53};
    /// Draw and light every patch from both sides, whatever its `one_sided` says.
    bool two_sided = false;

    /// Scalars a vertex in the meshes drawn (AttributeSchema::scalars.size()), which of them
    /// Show::kScalar shows, and the values at the two ends of the colour map.
    int scalar_count = 0;
    int scalar_index = 0;
    float scalar_min = 0, scalar_max = 1;
    /// DrawPatch::value at the two ends of the colour map of Show::kError.
    float value_min = 0, value_max = 1;

    /// Of surfaces without colours, and of the empty picture's first and last row, in sRGB.
    Rgba8 surface{208, 200, 188, 255};
    Rgba8 background_top{54, 60, 70, 255};
    Rgba8 background_bottom{24, 26, 31, 255};
};

/// The light of all lit views: warm from the one side, cool from the sky, some from the ground and
/// from the eye, for a surface that reads well from every direction. Shine is the 32nd power.
inline constexpr float kKeyLight[3] = {0.86f, 0.81f, 0.73f};
inline constexpr float kSkyLight[3] = {0.13f, 0.16f, 0.20f};
inline constexpr float kGroundLight[3] = {0.055f, 0.045f, 0.04f};
inline constexpr float kEyeLight = 0.07f;
inline constexpr float kShine = 0.12f;

/// Show::kWire: what a base colour is multiplied by, so far (in pixels) from the nearest edge of a
/// triangle whose least height is `height`: lines fade where triangles get too small for them.
inline constexpr float kWireReach = 1.25f, kWireDarkness = 0.8f;
inline constexpr float kWireLeastHeight = 2, kWireFade = 6;
inline float wireShade(float distance, float height) {
    const float line = std::clamp(kWireReach - distance, 0.0f, 1.0f);
    const float visible = std::clamp((height - kWireLeastHeight) / kWireFade, 0.0f, 1.0f);
    return 1 - kWireDarkness * line * visible;
}

/// Linear light of an sRGB value in [0, 1], which is clamped, or of a byte; the byte nearest to a
/// linear value, within a fifth of a step: srgbFromLinear(linearFromSrgb(byte)) == byte.
float linearFromSrgb(float srgb);
float linearFromSrgb(uint8_t srgb);
Vec3f linearFromSrgb(const Rgba8& srgb);
uint8_t srgbFromLinear(float linear);
Rgba8 srgbFromLinear(const Vec3f& linear);

/// The table behind srgbFromLinear: entry round(x * (kSrgbEntries - 1)) for x in [0, 1].
inline constexpr int kSrgbEntries = 8192;
const uint8_t* srgbTable();
/// As long, for what is no light: entry i is round(i * 255 / (kSrgbEntries - 1)).
const uint8_t* plainTable();
/// Linear light of the 256 bytes, in units of 1 / kLinearUnits.
inline constexpr int kLinearUnits = 8 * (kSrgbEntries - 1);
const uint16_t* linearUnitTable();

/// Colours of the debug views, in linear light; t is clamped to [0, 1].
Vec3f scalarColour(float t);          ///< dark violet, blue, green, yellow; even in lightness
Vec3f heatColour(float t);            ///< blue, green, yellow, red
Vec3f levelColour(float level);       ///< neighbouring levels differ well
Vec3f hashColour(uint64_t identity);  ///< a light colour that looks random

/// The colour in linear light that a patch as a whole has in a view; what a view takes from the
/// vertices or from the triangle instead multiplies it (Show::kShaded) or replaces it.
Vec3f patchColour(const ShadeSettings& settings, const DrawPatch& patch);
/// The same without the mesh; `coloured`: it has vertex colours.
Vec3f patchColour(const ShadeSettings& settings, uint32_t id, const Rgba8& tint, float value,
                  bool coloured);
/// One row of the background, in sRGB: pixel x has colour [x % 4]. Dithered, as the steps of so
/// gentle a gradient would be seen.
std::array<Rgba8, 4> backgroundRow(const ShadeSettings& settings, int y, int height);

}  // namespace pietra
