#include "render/raster/pixel_shader.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace pietra {

PixelShader::PixelShader(const View& view, const Projection& projection,
                         const ShadeSettings& settings)
    : projection_(projection),
      settings_(settings),
      view_{Vec3f(view.right()),
            Vec3f(view.up()),
            Vec3f(view.back()),
            float(view.size().width) / 2,
            float(view.size().height) / 2,
            float(1 / view.focal_px()),
            Vec3f(glm::normalize(settings.light_direction))},
      bytes_(settings.show == Show::kNormals ? plainTable() : srgbTable()) {}

void PixelShader::giveWeights(const BatchPatch& patch, const ShadeItem& item, size_t lane,
                              ShadeLanes& lanes) const {
    // The ray through the pixel against the planes of eye and edge, which is also right for corners
    // behind the eye.
    const Triangle& index = patch.triangle()[item.triangle];
    Vec3d v[3];
    for (int k = 0; k < 3; ++k)
        v[k] = Vec3d(projection_.viewPosition(patch.mesh().position[index[k]]));
    const Vec3d ray((double(item.x()) + 0.5 - view_.centre_x) * view_.inv_focal,
                    (view_.centre_y - double(item.y()) - 0.5) * view_.inv_focal, 1);
    lanes.any_given = true;
    lanes.given[lane] = -1;
    lanes.given_back[lane] = glm::dot(v[0], glm::cross(v[1], v[2])) < 0 ? -1 : 0;
    double weight[3], sum = 0;
    for (int k = 0; k < 3; ++k) {
        weight[k] = glm::dot(ray, glm::cross(v[(k + 1) % 3], v[(k + 2) % 3]));
        sum += weight[k];
    }
    for (int k = 0; k < 3; ++k) lanes.given_weight[k][lane] = float(weight[k] / sum);
}

void PixelShader::prepare(const BatchPatch& patch, ShadeLanes& lanes) const {
    lanes.both_sides = patch.both_sides;
    for (int c = 0; c < 3; ++c) std::fill_n(lanes.base[c], kShadeLanes, patch.colour[c]);
}

void PixelShader::gather(const BatchPatch& patch, std::span<const ShadeItem> items,
                         ShadeLanes& lanes) const {
    const Triangle* triangle = patch.triangle();
    const size_t last = items.size() - 1;
    for (size_t i = 0; i < size_t(kShadeLanes); ++i) {
        const ShadeItem& item = items[std::min(i, last)];
        const Triangle& index = triangle[item.triangle];
        for (int k = 0; k < 3; ++k) lanes.corner[k][i] = patch.vertex[index[k]];
        lanes.place[i] = int32_t(item.place);
    }
    lanes.any_given = false;
    if (patch.whole) return;
    for (size_t i = 0; i < size_t(kShadeLanes); ++i) {
        lanes.given[i] = 0;
        if (lanes.corner[0][i].x == kNoImage || lanes.corner[1][i].x == kNoImage ||
            lanes.corner[2][i].x == kNoImage)
            giveWeights(patch, items[std::min(i, last)], i, lanes);
    }
}

bool PixelShader::baseIsPatchColour(const BatchPatch& patch) const {
    switch (settings_.show) {
        case Show::kTriangles:
        case Show::kWire:
            return false;
        case Show::kScalar:
            return patch.mesh().scalar.empty();
        case Show::kShaded:
        case Show::kColour:
            return patch.mesh().colour.empty();
        default:
            return true;
    }
}

Vec3f PixelShader::baseColour(const BatchPatch& patch, uint32_t triangle,
                              const Vec3f& weight) const {
    const Mesh& mesh = patch.mesh();
    const Triangle& index = mesh.triangle[triangle];
    if (settings_.show == Show::kTriangles)
        return hashColour(uint64_t(patch.patch->id) << 32 | triangle);
    if (settings_.show == Show::kScalar) {
        float value = 0;
        for (int k = 0; k < 3; ++k)
            value += weight[k] * mesh.scalar[size_t(index[k]) * size_t(settings_.scalar_count) +
                                             size_t(settings_.scalar_index)];
        const float range = settings_.scalar_max - settings_.scalar_min;
        return scalarColour(range > 0 ? (value - settings_.scalar_min) / range : 0);
    }
    if (mesh.colour.empty()) return patch.colour;
    Vec3f linear(0, 0, 0);
    for (int k = 0; k < 3; ++k) linear += weight[k] * linearFromSrgb(mesh.colour[index[k]]);
    return settings_.show == Show::kColour ? linear : patch.colour * linear;
}

/// wireShade() at the pixel's centre; no line where a corner has no image.
float PixelShader::edgeLine(const ShadeLanes& lanes, size_t i) const {
    if (lanes.any_given && lanes.given[i]) return 1;
    constexpr float kUnit = 1.0f / kSubpixel;
    const glm::vec2 centre(float(lanes.place[i] & kPlaceMask) + 0.5f,
                           float(lanes.place[i] >> kPlaceBits & kPlaceMask) + 0.5f);
    glm::vec2 corner[3];
    for (int k = 0; k < 3; ++k)
        corner[k] = kUnit * glm::vec2(float(lanes.corner[k][i].x), float(lanes.corner[k][i].y));
    const auto cross = [](const glm::vec2& a, const glm::vec2& b) { return a.x * b.y - a.y * b.x; };
    const float area = std::abs(cross(corner[1] - corner[0], corner[2] - corner[0]));
    float distance = std::numeric_limits<float>::max(), height = distance;
    for (int k = 0; k < 3; ++k) {
        const glm::vec2 edge = corner[(k + 1) % 3] - corner[k];
        const float length = std::max(glm::length(edge), kUnit);
        distance = std::min(distance, std::abs(cross(edge, centre - corner[k])) / length);
        height = std::min(height, area / length);
    }
    return wireShade(distance, height);
}

void PixelShader::compute(const BatchPatch& patch, std::span<const ShadeItem> items,
                          ShadeLanes& lanes) const {
    interpolateLanes(view_, lanes);
    if (!baseIsPatchColour(patch)) {
        for (size_t i = 0; i < size_t(kShadeLanes); ++i) {
            const uint32_t triangle = items[std::min(i, items.size() - 1)].triangle;
            const Vec3f base = baseColour(
                patch, triangle, {lanes.weight[0][i], lanes.weight[1][i], lanes.weight[2][i]});
            const float line = settings_.show == Show::kWire ? edgeLine(lanes, i) : 1;
            for (int c = 0; c < 3; ++c) lanes.base[c][i] = line * base[c];
        }
    }
    if (settings_.show == Show::kNormals)
        showNormals(lanes);
    else if (settings_.show == Show::kColour)
        leaveUnlit(lanes);
    else
        lightLanes(view_, lanes);
}

}  // namespace pietra
