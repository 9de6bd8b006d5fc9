#include "render/shading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <span>

#include "base/hash.h"

namespace pietra {
namespace {

float clamp01(float x) {
    return x > 0 ? (x < 1 ? x : 1) : 0;
}

double fifthRoot(double x) {
    double r = 1;
    for (int i = 0; i < 14 && x > 0; ++i) r = (4 * r + x / (r * r * r * r)) / 5;  // Newton
    return x > 0 ? r : 0;
}

/// The standard's curve, without libm: x^2.4 = x^2 * (x^2)^(1/5).
double decodeSrgb(double srgb) {
    if (srgb <= 0.04045) return srgb / 12.92;
    const double t = (srgb + 0.055) / 1.055;
    return t * t * fifthRoot(t * t);
}

struct Tables {
    std::array<float, 256> linear;
    std::array<uint16_t, 256> linear_units;
    std::array<uint8_t, kSrgbEntries> srgb, plain;
    Tables() {
        for (int i = 0; i < 256; ++i) {
            linear[i] = float(decodeSrgb(i / 255.0));
            linear_units[i] = uint16_t(decodeSrgb(i / 255.0) * kLinearUnits + 0.5);
        }
        int byte = 0;
        for (int i = 0; i < kSrgbEntries; ++i) {
            while (byte < 255 && double(i) / (kSrgbEntries - 1) > decodeSrgb((byte + 0.5) / 255))
                ++byte;
            srgb[i] = uint8_t(byte);
            plain[i] = uint8_t((i * 255 * 2 + kSrgbEntries - 1) / (2 * (kSrgbEntries - 1)));
        }
    }
};

const Tables& tables() {
    static const Tables instance;
    return instance;
}

/// A colour map from sRGB anchors, evenly spaced.
Vec3f interpolate(std::span<const Vec3f> anchors, float t) {
    const float position = clamp01(t) * float(anchors.size() - 1);
    const size_t i = std::min(size_t(position), anchors.size() - 2);
    const float f = position - float(i);
    const Vec3f c = anchors[i] * (1 - f) + anchors[i + 1] * f;
    return {linearFromSrgb(c.x), linearFromSrgb(c.y), linearFromSrgb(c.z)};
}

/// `hue` in turns; saturation and value as in HSV, of sRGB.
Vec3f fromHue(float hue, float saturation, float value) {
    const auto channel = [&](float shift) {
        const float turn = hue + shift - std::floor(hue + shift);
        const float ramp = clamp01(std::abs(turn * 6 - 3) - 1);
        return linearFromSrgb(value * (1 - saturation * (1 - ramp)));
    };
    return {channel(0), channel(2.0f / 3), channel(1.0f / 3)};
}

}  // namespace

const uint8_t* srgbTable() {
    return tables().srgb.data();
}
const uint8_t* plainTable() {
    return tables().plain.data();
}
const uint16_t* linearUnitTable() {
    return tables().linear_units.data();
}

float linearFromSrgb(float srgb) {
    return float(decodeSrgb(clamp01(srgb)));
}

float linearFromSrgb(uint8_t srgb) {
    return tables().linear[srgb];
}

Vec3f linearFromSrgb(const Rgba8& srgb) {
    return {linearFromSrgb(srgb.r), linearFromSrgb(srgb.g), linearFromSrgb(srgb.b)};
}

uint8_t srgbFromLinear(float linear) {
    return srgbTable()[int(clamp01(linear) * float(kSrgbEntries - 1) + 0.5f)];
}

Rgba8 srgbFromLinear(const Vec3f& linear) {
    return {srgbFromLinear(linear.x), srgbFromLinear(linear.y), srgbFromLinear(linear.z), 255};
}

Vec3f scalarColour(float t) {
    static constexpr std::array<Vec3f, 6> anchors{
        Vec3f(0.25f, 0.02f, 0.34f), Vec3f(0.25f, 0.27f, 0.56f), Vec3f(0.15f, 0.47f, 0.57f),
        Vec3f(0.13f, 0.66f, 0.50f), Vec3f(0.49f, 0.82f, 0.30f), Vec3f(0.99f, 0.91f, 0.18f)};
    return interpolate(anchors, t);
}

Vec3f heatColour(float t) {
    static constexpr std::array<Vec3f, 5> anchors{
        Vec3f(0.23f, 0.35f, 0.80f), Vec3f(0.25f, 0.72f, 0.72f), Vec3f(0.55f, 0.82f, 0.35f),
        Vec3f(0.97f, 0.80f, 0.25f), Vec3f(0.84f, 0.19f, 0.16f)};
    return interpolate(anchors, t);
}

Vec3f levelColour(float level) {
    // The golden section never brings neighbours close.
    return fromHue(level * 0.618034f + 0.08f, 0.6f, 0.95f);
}

Vec3f hashColour(uint64_t identity) {
    const uint64_t bits = mixBits(identity + 0x9e3779b97f4a7c15ULL);
    const float hue = float(bits & 0xffff) / 65536.0f;
    const float saturation = 0.35f + 0.4f * float(bits >> 16 & 0xff) / 255.0f;
    const float value = 0.75f + 0.25f * float(bits >> 24 & 0xff) / 255.0f;
    return fromHue(hue, saturation, value);
}

Vec3f patchColour(const ShadeSettings& settings, uint32_t id, const Rgba8& tint, float value,
                  bool coloured) {
    switch (settings.show) {
        case Show::kLod:
            return levelColour(value);
        case Show::kPatches:
            return hashColour(id);
        case Show::kError: {
            const float range = settings.value_max - settings.value_min;
            return heatColour(range > 0 ? (value - settings.value_min) / range : 0);
        }
        case Show::kShaded:
        case Show::kWire:
            return linearFromSrgb(tint) *
                   (coloured ? Vec3f(1, 1, 1) : linearFromSrgb(settings.surface));
        default:
            return linearFromSrgb(settings.surface);
    }
}

Vec3f patchColour(const ShadeSettings& settings, const DrawPatch& patch) {
    return patchColour(settings, patch.id, patch.tint, patch.value, !patch.mesh->colour.empty());
}

std::array<Rgba8, 4> backgroundRow(const ShadeSettings& settings, int y, int height) {
    static constexpr int kBayer[4][4] = {
        {0, 8, 2, 10}, {12, 4, 14, 6}, {3, 11, 1, 9}, {15, 7, 13, 5}};
    const float t = height > 1 ? float(y) / float(height - 1) : 0;
    std::array<Rgba8, 4> row;
    for (int x = 0; x < 4; ++x) {
        const float threshold = (float(kBayer[y & 3][x]) + 0.5f) / 16;
        const auto mix = [&](uint8_t top, uint8_t bottom) {
            return uint8_t(float(top) * (1 - t) + float(bottom) * t + threshold);
        };
        const Rgba8 &top = settings.background_top, &bottom = settings.background_bottom;
        row[size_t(x)] = {mix(top.r, bottom.r), mix(top.g, bottom.g), mix(top.b, bottom.b), 255};
    }
    return row;
}

}  // namespace pietra
