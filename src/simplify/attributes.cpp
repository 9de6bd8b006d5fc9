#include "simplify/attributes.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace pietra {
namespace {

/// Steeper is noise on slivers, and would drown the planes in rounding errors.
constexpr float kMaxGradient = 16;

OctNormal mixNormals(const OctNormal& a, const OctNormal& b, float t) {
    const Vec3f n = decodeNormal(a) * (1 - t) + decodeNormal(b) * t;
    return glm::dot(n, n) > 1e-12f ? encodeNormal(n) : t < 0.5f ? a : b;
}

uint8_t toByte(float x) {
    return uint8_t(std::clamp(x + 0.5f, 0.0f, 255.0f));
}

uint8_t mixBytes(uint8_t a, uint8_t b, float t) {
    return toByte(float(a) + (float(b) - float(a)) * t);
}

/// A gradient of a linear function that rises by `rise1` along `edge1` and `rise2` along `edge2`.
Vec3f gradientOf(const Vec3f& edge1, const Vec3f& edge2, float rise1, float rise2,
                 const Vec3f& normal, float double_area) {
    const Vec3f g =
        (glm::cross(edge2, normal) * rise1 + glm::cross(normal, edge1) * rise2) / double_area;
    const float length_sq = glm::dot(g, g);
    if (!(length_sq < 1e12f)) return {0, 0, 0};
    return length_sq > kMaxGradient * kMaxGradient ? g * (kMaxGradient / std::sqrt(length_sq)) : g;
}

void addGradient(const Vec3f& g, float weight, Quadric& q) {
    const Vec3f w = g * weight;
    q.a00 += w.x * g.x, q.a11 += w.y * g.y, q.a22 += w.z * g.z, q.a01 += w.x * g.y;
    q.a02 += w.x * g.z, q.a12 += w.y * g.z;
}

}  // namespace

void VertexAttributes::load(const Mesh& mesh, uint32_t scalar_count,
                            std::span<const float> scalar_range, float extent) {
    CHECK(scalar_range.empty() || scalar_range.size() == scalar_count);
    normal_ = mesh.normal;
    colour_ = mesh.colour;
    scalar_ = mesh.scalar;
    scalar_count_ = scalar_count;
    colour_count_ = mesh.colour.empty() ? 0 : 3;
    count_ = std::min(colour_count_ + scalar_count, kMaxQuadricAttributes);
    stride_ = (count_ + 3) / 4 * 4;
    row_.assign(mesh.vertexCount() * count_, AttributeRow{});
    setRanges(scalar_range, extent * kAttributeShare);
    value_.assign(mesh.vertexCount() * stride_, 0.0f);
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) loadValues(v);
}

void VertexAttributes::setRanges(std::span<const float> scalar_range, float span) {
    scale_.assign(count_, span / 255);
    offset_.assign(count_, 0.0f);
    for (uint32_t j = colour_count_; j < count_; ++j) {
        const uint32_t s = j - colour_count_;
        float low = HUGE_VALF, high = -HUGE_VALF;
        for (size_t i = s; i < scalar_.size(); i += scalar_count_) {
            if (!std::isfinite(scalar_[i])) continue;
            low = std::min(low, scalar_[i]);
            high = std::max(high, scalar_[i]);
        }
        const float range = scalar_range.empty() ? high - low : scalar_range[s];
        offset_[j] = low <= high ? low : 0;
        scale_[j] = range > 0 && std::isfinite(span / range) ? span / range : 0;
    }
}

void VertexAttributes::loadValues(uint32_t v) {
    float* value = value_.data() + size_t(v) * stride_;
    if (colour_count_ != 0) {
        value[0] = float(colour_[v].r) * scale_[0];
        value[1] = float(colour_[v].g) * scale_[1];
        value[2] = float(colour_[v].b) * scale_[2];
    }
    for (uint32_t j = colour_count_; j < count_; ++j) {
        const float s = scalar_[size_t(v) * scalar_count_ + j - colour_count_];
        value[j] = std::isfinite(s) ? (s - offset_[j]) * scale_[j] : 0;
    }
}

void VertexAttributes::addFace(const WorkingMesh& mesh, const Face& face, const Vec3f& normal,
                               float double_area, float weight, Quadric& quadric) {
    const Vec3f origin = mesh.point[face.v[0]].vec();
    const Vec3f edge1 = mesh.point[face.v[1]].vec() - origin;
    const Vec3f edge2 = mesh.point[face.v[2]].vec() - origin;
    for (uint32_t j = 0; j < count_; ++j) {
        const auto value = [&](int k) { return value_[size_t(face.v[k]) * stride_ + j]; };
        const Vec3f g =
            gradientOf(edge1, edge2, value(1) - value(0), value(2) - value(0), normal, double_area);
        addGradient(g, weight, quadric);
        for (const uint32_t v : face.v) {
            AttributeRow& row = row_[size_t(v) * count_ + j];
            row.gx += weight * g.x;
            row.gy += weight * g.y;
            row.gz += weight * g.z;
        }
    }
}

void VertexAttributes::merge(WorkingMesh& mesh, uint32_t u, uint32_t v, const Vec3f& from,
                             const Vec3f& to, const Vec3f& at, const float* values) {
    // note: what stays where it was keeps its attributes to the bit: others may share the vertex.
    if (at == to) values = value_.data() + size_t(v) * stride_;
    if (at == from) values = value_.data() + size_t(u) * stride_;
    Quadric of_u = mesh.quadric[u].movedBy(at - from), of_v = mesh.quadric[v].movedBy(at - to);
    moveRows(u, at - from, values, of_u);
    moveRows(v, at - to, values, of_v);
    of_v.add(of_u);
    mesh.quadric[v] = of_v;
    for (uint32_t j = 0; j < count_; ++j) {
        const AttributeRow& a = row_[size_t(u) * count_ + j];
        AttributeRow& b = row_[size_t(v) * count_ + j];
        b = {a.gx + b.gx, a.gy + b.gy, a.gz + b.gz, a.d + b.d};
    }
    if (at == to) return;
    if (at == from) {
        copyAttributes(u, v);
        return;
    }
    const Vec3f edge = to - from;
    const float t = std::clamp(glm::dot(at - from, edge) / glm::dot(edge, edge), 0.0f, 1.0f);
    mixAttributes(u, v, t, values);
}

/// Centres the rows of `v` at the point `d` further on and at the values `target`, with what that
/// changes in its quadric, already moved there.
void VertexAttributes::moveRows(uint32_t v, const Vec3f& d, const float* target, Quadric& quadric) {
    const float weight = quadric.area;
    for (uint32_t j = 0; j < count_; ++j) {
        AttributeRow& row = row_[size_t(v) * count_ + j];
        const float step = target[j] - value_[size_t(v) * stride_ + j];
        const float moved = row.d + (row.gx * d.x + row.gy * d.y + row.gz * d.z);
        quadric.c += step * (weight * step - 2 * moved);
        quadric.b0 -= step * row.gx;
        quadric.b1 -= step * row.gy;
        quadric.b2 -= step * row.gz;
        row.d = moved - weight * step;
    }
}

void VertexAttributes::copyAttributes(uint32_t u, uint32_t v) {
    normal_[v] = normal_[u];
    if (!colour_.empty()) colour_[v] = colour_[u];
    for (uint32_t i = 0; i < scalar_count_; ++i)
        scalar_[size_t(v) * scalar_count_ + i] = scalar_[size_t(u) * scalar_count_ + i];
    for (uint32_t j = 0; j < stride_; ++j)
        value_[size_t(v) * stride_ + j] = value_[size_t(u) * stride_ + j];
}

void VertexAttributes::mixAttributes(uint32_t u, uint32_t v, float t, const float* values) {
    normal_[v] = mixNormals(normal_[u], normal_[v], t);
    if (!colour_.empty())
        colour_[v] = {toByte(values[0] / scale_[0]), toByte(values[1] / scale_[1]),
                      toByte(values[2] / scale_[2]), mixBytes(colour_[u].a, colour_[v].a, t)};
    for (uint32_t i = 0; i < scalar_count_; ++i) {
        const uint32_t j = colour_count_ + i;
        const float a = scalar_[size_t(u) * scalar_count_ + i];
        float& b = scalar_[size_t(v) * scalar_count_ + i];
        if (!std::isfinite(a) || !std::isfinite(b))
            b = t < 0.5f ? a : b;
        else if (j < count_ && scale_[j] > 0)
            b = values[j] / scale_[j] + offset_[j];
        else
            b = a + (b - a) * t;
    }
    std::copy_n(values, count_, value_.data() + size_t(v) * stride_);
}

void VertexAttributes::resizeOutput(Mesh& out, size_t vertices) const {
    out.normal.resize(vertices);
    out.colour.resize(colour_.empty() ? 0 : vertices);
    out.scalar.resize(vertices * scalar_count_);
}

void VertexAttributes::store(uint32_t v, Mesh& out, uint32_t to) const {
    out.normal[to] = normal_[v];
    if (!colour_.empty()) out.colour[to] = colour_[v];
    for (uint32_t i = 0; i < scalar_count_; ++i)
        out.scalar[size_t(to) * scalar_count_ + i] = scalar_[size_t(v) * scalar_count_ + i];
}

}  // namespace pietra
