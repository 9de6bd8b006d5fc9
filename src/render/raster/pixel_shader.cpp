#include "render/raster/pixel_shader.h"

#include "base/check.h"

namespace pietra {

struct PixelShader::Source {
    const BatchPatch* patch;
    uint32_t triangle;
    Triangle index;
};

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
      base_is_patch_(settings.show == Show::kLod || settings.show == Show::kPatches ||
                     settings.show == Show::kError || settings.show == Show::kNormals) {}

void PixelShader::giveWeights(const Source& source, const ShadeItem& item, size_t lane,
                              ShadeLanes& lanes) const {
    // The ray through the pixel against the planes of eye and edge, which is also right for corners
    // behind the eye.
    const Mesh& mesh = *source.patch->patch->mesh;
    Vec3d v[3];
    for (int k = 0; k < 3; ++k)
        v[k] = Vec3d(projection_.viewPosition(mesh.position[source.index[k]]));
    const Vec3d ray((double(item.x) + 0.5 - view_.centre_x) * view_.inv_focal,
                    (view_.centre_y - double(item.y) - 0.5) * view_.inv_focal, 1);
    lanes.given[lane] = -1;
    lanes.given_back[lane] = glm::dot(v[0], glm::cross(v[1], v[2])) > 0 ? -1 : 0;
    double weight[3], sum = 0;
    for (int k = 0; k < 3; ++k) {
        weight[k] = glm::dot(ray, glm::cross(v[(k + 1) % 3], v[(k + 2) % 3]));
        sum += weight[k];
    }
    for (int k = 0; k < 3; ++k) lanes.given_weight[k][lane] = float(weight[k] / sum);
}

void PixelShader::gather(const Batch& batch, const ShadeItem& item, size_t lane, Source& source,
                         ShadeLanes& lanes) const {
    const BatchPatch& patch = batch.patchOf(item.number);
    source.patch = &patch;
    source.triangle = item.number - patch.first_number;
    source.index = patch.patch->mesh->triangle[source.triangle];
    const ScreenVertex* vertex = batch.vertex.data() + patch.first_vertex;
    for (int k = 0; k < 3; ++k) lanes.corner[k][lane] = vertex[source.index[k]];
    lanes.x[lane] = item.x;
    lanes.y[lane] = item.y;
    lanes.both_sides[lane] = patch.both_sides ? -1 : 0;
    lanes.base[0][lane] = patch.colour.x;
    lanes.base[1][lane] = patch.colour.y;
    lanes.base[2][lane] = patch.colour.z;
    if (!patch.whole)
        for (int k = 0; k < 3; ++k)
            if (lanes.corner[k][lane].x == kNoImage) return giveWeights(source, item, lane, lanes);
}

Vec3f PixelShader::baseColour(const Source& source, size_t lane, const ShadeLanes& lanes) const {
    const Mesh& mesh = *source.patch->patch->mesh;
    const Vec3f weight(lanes.weight[0][lane], lanes.weight[1][lane], lanes.weight[2][lane]);
    switch (settings_.show) {
        case Show::kTriangles:
            return hashColour(uint64_t(source.patch->patch->id) << 32 | source.triangle);
        case Show::kScalar: {
            if (mesh.scalar.empty()) return source.patch->colour;
            float value = 0;
            for (int k = 0; k < 3; ++k)
                value += weight[k] *
                         mesh.scalar[size_t(source.index[k]) * size_t(settings_.scalar_count) +
                                     size_t(settings_.scalar_index)];
            const float range = settings_.scalar_max - settings_.scalar_min;
            return scalarColour(range > 0 ? (value - settings_.scalar_min) / range : 0);
        }
        default: {
            if (mesh.colour.empty()) return source.patch->colour;
            Vec3f linear(0, 0, 0);
            for (int k = 0; k < 3; ++k)
                linear += weight[k] * linearFromSrgb(mesh.colour[source.index[k]]);
            return settings_.show == Show::kShaded ? source.patch->colour * linear : linear;
        }
    }
}

void PixelShader::shade(const Batch& batch, std::span<const ShadeItem> items, Rgba8* colour) const {
    DCHECK(items.size() <= size_t(kShadeLanes));
    ShadeLanes lanes;
    Source source[kShadeLanes];
    for (int32_t& given : lanes.given) given = 0;
    for (size_t i = 0; i < size_t(kShadeLanes); ++i)
        gather(batch, items[std::min(i, items.size() - 1)], i, source[i], lanes);
    interpolateLanes(view_, lanes);
    if (!base_is_patch_)
        for (size_t i = 0; i < items.size(); ++i) {
            if (settings_.show == Show::kShaded && source[i].patch->patch->mesh->colour.empty())
                continue;
            const Vec3f base = baseColour(source[i], i, lanes);
            for (int c = 0; c < 3; ++c) lanes.base[c][i] = base[c];
        }
    if (settings_.show == Show::kNormals) {
        const auto byte = [](float v) { return uint8_t((v * 0.5f + 0.5f) * 255.0f + 0.5f); };
        for (size_t i = 0; i < items.size(); ++i)
            colour[i] = {byte(lanes.normal[0][i]), byte(lanes.normal[1][i]),
                         byte(lanes.normal[2][i]), 255};
        return;
    }
    const bool unlit = settings_.show == Show::kColour;
    if (!unlit) lightLanes(view_, lanes);
    const auto& linear = unlit ? lanes.base : lanes.lit;
    for (size_t i = 0; i < items.size(); ++i)
        colour[i] = srgbFromLinear(Vec3f(linear[0][i], linear[1][i], linear[2][i]));
}

}  // namespace pietra
