#pragma once
// What vertices carry besides their position, while a mesh is being simplified: normals, colours,
// scalars. Colours and scalars are part of the quadrics (Hoppe 1999), so that their edges survive;
// normals, alpha and scalars beyond the eighth attribute are interpolated along the collapsed edge.
//
// An attribute s is linear on a triangle: s(z) = g.z + d. A vertex's quadric then has, besides
// f(z) = z'Az + 2b'z + c (with the g and d of all attributes in A, b, c), for each attribute the
// sums G of g and D of d, weighted: f(z, t) = f(z) + sum over attributes of W t^2 - 2 t (G.z + D).
// Like z, t is relative to the vertex, so all but A, G and W vanish at first. At the best t, which
// is (G.z + D) / W, this is a quadric in z alone.

#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "simplify/attribute_rows.h"
#include "simplify/working_mesh.h"

namespace pietra {

/// The whole range of an attribute counts like this part of the mesh's extent: about two edges in a
/// diamond. So a sharp edge of full contrast is worth a crease, and the noise of a scanned colour
/// less than that of its surface.
inline constexpr float kAttributeShare = 1.0f / 64;

class VertexAttributes {
public:
    /// `scalar_range`: one a scalar, or empty: then that of this mesh. `extent`: the longest side
    /// of the mesh's box.
    void load(const Mesh& mesh, uint32_t scalar_count, std::span<const float> scalar_range,
              float extent);

    bool inQuadrics() const { return count_ != 0; }
    AttributeView view() const { return {row_.data(), value_.data(), count_, stride_}; }

    /// Adds the gradients on a triangle of the given normal (unit) and twice the area to the
    /// quadric that its vertices get, and to their rows.
    void addFace(const WorkingMesh& mesh, const Face& face, const Vec3f& normal, float double_area,
                 float weight, Quadric& quadric);

    /// Vertex u, at `from`, and v, at `to`, have become one at `at`, which is v: merges quadrics
    /// and attributes. `values`: one for each attribute in the quadrics, the best ones there.
    void merge(WorkingMesh& mesh, uint32_t u, uint32_t v, const Vec3f& from, const Vec3f& to,
               const Vec3f& at, const float* values);

    /// Makes room for attributes of so many vertices in `out`.
    void resizeOutput(Mesh& out, size_t vertices) const;
    /// Those of `v` become those of vertex `to` of `out`.
    void store(uint32_t v, Mesh& out, uint32_t to) const;

    void prefetch(uint32_t v) const { __builtin_prefetch(&normal_[v]); }

private:
    void setRanges(std::span<const float> scalar_range, float extent);
    void loadValues(uint32_t v);
    void moveRows(uint32_t v, const Vec3f& d, const float* target, Quadric& quadric);
    void copyAttributes(uint32_t u, uint32_t v);
    void mixAttributes(uint32_t u, uint32_t v, float t, const float* values);

    uint32_t count_ = 0;  // attributes in the quadrics
    uint32_t stride_ = 0;
    uint32_t colour_count_ = 0;  // of these: 0 or 3
    uint32_t scalar_count_ = 0;  // all scalars, in the quadrics or not
    std::vector<AttributeRow> row_;
    std::vector<float> value_;
    std::vector<float> scale_, offset_;  // value = (attribute - offset) * scale
    std::vector<OctNormal> normal_;
    std::vector<Rgba8> colour_;
    std::vector<float> scalar_;
};

}  // namespace pietra
