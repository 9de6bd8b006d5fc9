#include "methods/cluster/layer_step.h"

#include <algorithm>
#include <cmath>

#include "methods/cluster/anchors.h"
#include "methods/cluster/interfaces.h"
#include "simplify/deviation_direction.h"

namespace pietra::cluster {

namespace {

/// Where to look for what became of each triangle: among those of its super face, by turns.
std::vector<uint32_t> triangleMap(const LayerTriangles& below, const LayerTriangles& layer,
                                  std::span<const uint32_t> super_face) {
    std::vector<uint32_t> first(layer.face.empty() ? 1 : layer.face.back() + 2, 0), next, map;
    for (const uint32_t f : layer.face) ++first[f + 1];
    for (size_t f = 1; f < first.size(); ++f) first[f] += first[f - 1];
    next = first;
    for (const uint32_t f : below.face) {
        const uint32_t s = super_face[f];
        if (next[s] == first[s + 1]) next[s] = first[s];
        map.push_back(next[s]++);
    }
    return map;
}

}  // namespace

LayerStep nextLayer(const PolygonMesh& below, const LayerTriangles& below_triangles,
                    std::span<const uint8_t> removed, uint32_t faces_each,
                    const ClusterSettings& settings) {
    const Groups fans = fansWithout(below, removed);
    std::vector<uint8_t> stays;
    for (const uint32_t name : below.name) stays.push_back(!removed[name]);
    const PolygonMesh polygons = mergeFaces(below, fans, stays);
    const Groups groups = clusterFaces(polygons, below.faceCount() / faces_each, settings);
    LayerStep step;
    step.polygons = mergeFaces(polygons, groups, findAnchors(polygons, groups));
    step.triangles = triangulate(step.polygons);
    std::vector<uint32_t> super_face;
    for (const uint32_t fan : fans.of_face) super_face.push_back(groups.of_face[fan]);
    step.triangle_map = triangleMap(below_triangles, step.triangles, super_face);
    return step;
}

float boundLayer(const Mesh& below, float error, const Mesh& layer,
                 std::span<const uint32_t> triangle_map, Deviation& deviation, FaceBounds& bounds) {
    DeviationInput step;
    step.before = &below;
    step.before_bounds = &bounds;
    step.after = &layer;
    step.triangle_map = triangle_map;
    step.child_error = error;
    FaceBounds after;
    const float bound = deviation.run(step, after);
    bounds = std::move(after);
    return std::max(bound, error);
}

std::vector<float> boundStrips(const Mesh& strips, const Mesh& below, float error,
                               const FaceBounds& bounds) {
    std::vector<float> value(strips.triangleCount(), 0);
    if (value.empty()) return value;
    deviation::Surface source, target;
    source.assign(strips);
    target.assign(below);
    deviation::Direction direction;
    deviation::Progressing progress{error, 0};
    direction.begin(source, target, {}, bounds.from_original, value, false);
    for (uint32_t t = 0; t < value.size(); ++t) {
        const Vec3f origin = source.corner(t, 0);
        const Vec3f middle = (source.corner(t, 1) - origin + source.corner(t, 2) - origin) / 3.0f;
        direction.cover(t, target.nearest(origin, middle, {}, {0, HUGE_VALF}).face, progress);
    }
    direction.finish(progress);
    return value;
}

}  // namespace pietra::cluster
