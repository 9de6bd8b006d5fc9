#include "render/raster/pixel_shader.h"

namespace pietra {
namespace {

/// A mix of warm light from one side, cool sky light from above and a little from the eye, for a
/// surface that reads well from every direction.
constexpr Vec3f kKeyLight{1.02f, 0.98f, 0.92f};
constexpr Vec3f kSkyLight{0.19f, 0.22f, 0.26f};
constexpr Vec3f kGroundLight{0.09f, 0.075f, 0.065f};
constexpr float kEyeLight = 0.12f;
constexpr float kShine = 0.10f;

float positive(float x) {
    return x > 0 ? x : 0;
}

Vec3f normalized(const Vec3f& v) {
    const float square = v.x * v.x + v.y * v.y + v.z * v.z;
    return square > 0 ? v * (1 / std::sqrt(square)) : Vec3f(0, 0, 1);
}

float dot(const Vec3f& a, const Vec3f& b) {
    return a.x * b.x + a.y * b.y + a.z * b.z;
}

}  // namespace

struct PixelShader::Corners {
    const BatchPatch& patch;
    uint32_t triangle;
    Triangle index;
    ScreenVertex vertex[3];

    Corners(const Batch& batch, uint32_t number)
        : patch(batch.patchOf(number)),
          triangle(number - patch.first_number),
          index(patch.patch->mesh->triangle[triangle]) {
        for (int k = 0; k < 3; ++k) vertex[k] = batch.vertex[patch.first_vertex + index[k]];
    }
    const Mesh& mesh() const { return *patch.patch->mesh; }
};

PixelShader::PixelShader(const View& view, const Projection& projection,
                         const ShadeSettings& settings)
    : projection_(projection),
      settings_(settings),
      right_(view.right()),
      up_(view.up()),
      back_(view.back()),
      centre_x_(float(view.size().width) / 2),
      centre_y_(float(view.size().height) / 2),
      inv_focal_(float(1 / view.focal_px())),
      light_(glm::normalize(settings.light_direction)) {}

Vec3f PixelShader::barycentric(const Corners& c, int32_t x, int32_t y, bool& back) const {
    float e0, e1, e2;
    if (c.vertex[0].x != kNoImage && c.vertex[1].x != kNoImage && c.vertex[2].x != kNoImage) {
        const int32_t at_x = x * kSubpixel + kHalfPixel, at_y = y * kSubpixel + kHalfPixel;
        float dx[3], dy[3];
        for (int k = 0; k < 3; ++k) {
            dx[k] = float(c.vertex[k].x - at_x);
            dy[k] = float(c.vertex[k].y - at_y);
        }
        e0 = dx[1] * dy[2] - dx[2] * dy[1];
        e1 = dx[2] * dy[0] - dx[0] * dy[2];
        e2 = dx[0] * dy[1] - dx[1] * dy[0];
        back = e0 + e1 + e2 > 0;
        e0 *= c.vertex[0].inv_depth;
        e1 *= c.vertex[1].inv_depth;
        e2 *= c.vertex[2].inv_depth;
    } else {
        // The ray through the pixel against the planes of eye and edge: also right for corners
        // behind the eye.
        Vec3d v[3];
        for (int k = 0; k < 3; ++k)
            v[k] = Vec3d(projection_.viewPosition(c.mesh().position[c.index[k]]));
        const Vec3d ray((double(x) + 0.5 - centre_x_) * inv_focal_,
                        (centre_y_ - double(y) - 0.5) * inv_focal_, 1);
        e0 = float(glm::dot(ray, glm::cross(v[1], v[2])));
        e1 = float(glm::dot(ray, glm::cross(v[2], v[0])));
        e2 = float(glm::dot(ray, glm::cross(v[0], v[1])));
        back = glm::dot(v[0], glm::cross(v[1], v[2])) > 0;
    }
    const float sum = e0 + e1 + e2;
    const float inverse = sum != 0 ? 1 / sum : 0;
    Vec3f b(positive(e0 * inverse), positive(e1 * inverse), positive(e2 * inverse));
    const float clamped = b.x + b.y + b.z;
    return clamped > 0 ? b * (1 / clamped) : Vec3f(1, 0, 0);
}

Vec3f PixelShader::light(const Vec3f& base, const Vec3f& n, const Vec3f& to_eye) const {
    const float key = positive(dot(n, light_));
    const float eye = positive(dot(n, to_eye)) * kEyeLight;
    const float sky = 0.5f + 0.5f * n.y;
    const Vec3f diffuse = kKeyLight * (key * 0.85f) + kSkyLight * sky + kGroundLight * (1 - sky) +
                          Vec3f(eye, eye, eye);
    float shine = positive(dot(n, normalized(light_ + to_eye)));
    for (int k = 0; k < 5; ++k) shine *= shine;  // the 32nd power
    if (!(key > 0)) shine = 0;
    return base * diffuse + kKeyLight * (shine * kShine);
}

Vec3f PixelShader::baseColour(const Batch&, const Corners& c, const Vec3f& weight) const {
    const Mesh& mesh = c.mesh();
    switch (settings_.show) {
        case Show::kTriangles:
            return hashColour(uint64_t(c.patch.patch->id) << 32 | c.triangle);
        case Show::kScalar: {
            if (mesh.scalar.empty()) return c.patch.colour;
            float value = 0;
            for (int k = 0; k < 3; ++k)
                value +=
                    weight[k] * mesh.scalar[size_t(c.index[k]) * size_t(settings_.scalar_count) +
                                            size_t(settings_.scalar_index)];
            const float range = settings_.scalar_max - settings_.scalar_min;
            return scalarColour(range > 0 ? (value - settings_.scalar_min) / range : 0);
        }
        case Show::kShaded:
        case Show::kColour: {
            if (mesh.colour.empty()) return c.patch.colour;
            Vec3f linear(0, 0, 0);
            for (int k = 0; k < 3; ++k)
                linear += weight[k] * linearFromSrgb(mesh.colour[c.index[k]]);
            return settings_.show == Show::kShaded ? c.patch.colour * linear : linear;
        }
        default:
            return c.patch.colour;
    }
}

Rgba8 PixelShader::shade(const Batch& batch, uint32_t number, int32_t x, int32_t y) const {
    const Corners corners(batch, number);
    bool back = false;
    const Vec3f weight = barycentric(corners, x, y, back);
    const Vec3f base = baseColour(batch, corners, weight);
    if (settings_.show == Show::kColour) return srgbFromLinear(base);
    Vec3f world(0, 0, 0);
    for (int k = 0; k < 3; ++k) world += weight[k] * decodeNormal(corners.vertex[k].normal);
    Vec3f n = normalized(Vec3f(dot(world, right_), dot(world, up_), dot(world, back_)));
    const Vec3f to_eye = normalized(Vec3f((centre_x_ - float(x) - 0.5f) * inv_focal_,
                                          (float(y) + 0.5f - centre_y_) * inv_focal_, 1));
    // A sliver's side may be lost to rounding, and near a silhouette normals point away from faces
    // that are seen: only both together, or a normal that is clearly wrong, turn it round.
    const float facing = dot(n, to_eye);
    if (corners.patch.both_sides && facing < (back ? 0.0f : -0.25f)) n = -n;
    if (settings_.show == Show::kNormals) {
        const auto byte = [](float v) { return uint8_t((v * 0.5f + 0.5f) * 255.0f + 0.5f); };
        return {byte(n.x), byte(n.y), byte(n.z), 255};
    }
    return srgbFromLinear(light(base, n, to_eye));
}

}  // namespace pietra
