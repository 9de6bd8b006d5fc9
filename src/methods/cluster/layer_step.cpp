#include "methods/cluster/layer_step.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <unordered_map>

#include "coarsen/key_map.h"
#include "geometry/lattice.h"
#include "methods/cluster/anchors.h"
#include "methods/cluster/interfaces.h"
#include "simplify/deviation_direction.h"

namespace pietra::cluster {

namespace {

/// A strip to which more than this part of the layer's bound is given, and more than its height, is
/// not worth its cost to who takes it.
constexpr float kSmallPart = 0.25f;

/// How often polygons that fold over get a vertex back.
constexpr int kUnfoldingRounds = 1;

/// Where to look for what became of each triangle: the one of its super face whose middle is
/// nearest to its own.
std::vector<uint32_t> triangleMap(const LayerTriangles& below, const LayerTriangles& layer,
                                  std::span<const uint32_t> super_face) {
    std::vector<uint32_t> first(layer.face.empty() ? 1 : layer.face.back() + 2, 0), map;
    for (const uint32_t f : layer.face) ++first[f + 1];
    for (size_t f = 1; f < first.size(); ++f) first[f] += first[f - 1];
    const auto middle = [](const Mesh& mesh, size_t t) {
        const auto& [a, b, c] = mesh.triangle[t];
        return Vec3f(mesh.position[a] + mesh.position[b] + mesh.position[c]);
    };
    std::vector<Vec3f> middles;
    for (size_t t = 0; t < layer.mesh.triangleCount(); ++t)
        middles.push_back(middle(layer.mesh, t));
    map.reserve(below.face.size());
    for (size_t t = 0; t < below.face.size(); ++t) {
        const uint32_t s = super_face[below.face[t]];
        const Vec3f here = middle(below.mesh, t);
        uint32_t best = first[s];
        float least = HUGE_VALF;
        for (uint32_t k = first[s]; k < first[s + 1]; ++k) {
            const Vec3f way = middles[k] - here;
            if (const float d = glm::dot(way, way); d < least) least = d, best = k;
        }
        map.push_back(best);
    }
    return map;
}

float largestOf(const FaceBounds& bounds, float least) {
    for (const float a : bounds.to_original) least = std::max(least, a);
    for (const float b : bounds.from_original) least = std::max(least, b);
    return least;
}

/// Of each triangle of the layer, whether it is another one than what was mapped to it.
std::vector<uint8_t> changedTriangles(const Mesh& below, const Mesh& layer,
                                      std::span<const uint32_t> triangle_map) {
    const auto corners = [](const Mesh& mesh, size_t t) {
        const auto& [a, b, c] = mesh.triangle[t];
        std::array keys = {latticeKey(mesh.position[a]), latticeKey(mesh.position[b]),
                           latticeKey(mesh.position[c])};
        std::sort(keys.begin(), keys.end());
        return keys;
    };
    std::vector<uint8_t> changed(layer.triangleCount(), 1);
    for (size_t t = 0; t < triangle_map.size(); ++t)
        if (const uint32_t to = triangle_map[t];
            to < changed.size() && corners(below, t) == corners(layer, to))
            changed[to] = 0;
    return changed;
}

}  // namespace

LayerStep nextLayer(const PolygonMesh& below, const LayerTriangles& below_triangles,
                    std::span<const uint8_t> removed, uint32_t faces_each, const Box3i& room,
                    const ClusterSettings& settings) {
    const Groups fans = fansWithout(below, removed);
    std::vector<uint8_t> stays;
    for (const uint32_t name : below.name) stays.push_back(!removed[name]);
    const PolygonMesh polygons = mergeFaces(below, fans, stays);
    const Groups groups = clusterFaces(polygons, below.faceCount() / faces_each, settings);
    LayerStep step;
    std::vector<uint8_t> keep = findAnchors(polygons, groups);
    const std::vector<uint32_t> starts = outlineStarts(polygons, groups);
    for (int round = 0;; ++round) {
        step.polygons = mergeFaces(polygons, groups, keep);
        step.moved = moveAnchors(step.polygons, room);
        step.triangles = triangulate(step.polygons);
        bool changed = false;
        if (round < kUnfoldingRounds)
            for (const uint32_t g : step.triangles.folded)
                changed |= keepFarthest(polygons, groups, starts[g], keep);
        if (!changed) break;
    }
    std::vector<uint32_t> super_face;
    for (const uint32_t fan : fans.of_face) super_face.push_back(groups.of_face[fan]);
    step.triangle_map = triangleMap(below_triangles, step.triangles, super_face);
    return step;
}

namespace {

/// `mesh` and then the strips, whose corners are vertices of `mesh` where it has their positions.
Mesh withStrips(const Mesh& mesh, const Mesh& strips) {
    Mesh whole;
    whole.position = mesh.position;
    whole.triangle = mesh.triangle;
    std::unordered_map<uint64_t, uint32_t> vertex;
    for (const Vec3i& p : strips.position) vertex.emplace(latticeKey(p), kNone);
    for (uint32_t v = 0; v < mesh.vertexCount() && !vertex.empty(); ++v)
        if (const auto at = vertex.find(latticeKey(mesh.position[v])); at != vertex.end())
            at->second = v;
    for (Triangle triangle : strips.triangle) {
        for (uint32_t& corner : triangle) {
            const Vec3i& p = strips.position[corner];
            uint32_t& v = vertex.at(latticeKey(p));
            if (v == kNone) {
                v = uint32_t(whole.position.size());
                whole.position.push_back(p);
            }
            corner = v;
        }
        whole.triangle.push_back(triangle);
    }
    return whole;
}

/// How far a strip's removed vertex lies off the other two; given strips.
float heightOf(const Mesh& strips, size_t i) {
    const Triangle& t = strips.triangle[i];
    const Vec3d a(strips.position[t[0]]), edge = Vec3d(strips.position[t[2]]) - a;
    const Vec3d across = glm::cross(edge, Vec3d(strips.position[t[1]]) - a);
    return float(std::sqrt(glm::dot(across, across) / glm::dot(edge, edge)));
}

/// Covers `strips` by faces of `target`, looking first where that is nearest.
void coverStrips(const Mesh& strips, const Mesh& target, std::span<const float> base,
                 std::span<const float> offset, float error, std::span<float> value,
                 bool by_target) {
    deviation::Surface from, to;
    from.assign(strips);
    to.assign(target);
    deviation::Direction direction;
    deviation::Progressing progress{error, 0};
    direction.begin(from, to, base, offset, value, by_target);
    for (uint32_t t = 0; t < from.faceCount(); ++t) {
        const Vec3f origin = from.corner(t, 0);
        const Vec3f middle = (from.corner(t, 1) - origin + from.corner(t, 2) - origin) / 3.0f;
        direction.cover(t, to.nearest(origin, middle, {}, {0, HUGE_VALF}).face, progress);
    }
    direction.finish(progress);
}

}  // namespace

float boundLayer(const Mesh& below, float error, const Mesh& layer,
                 std::span<const uint32_t> triangle_map, Deviation& deviation, FaceBounds& bounds) {
    std::vector<float> given_bound;
    return boundLayer(below, error, layer, triangle_map, {}, deviation, bounds, given_bound);
}

float boundLayer(const Mesh& below, float error, const Mesh& layer,
                 std::span<const uint32_t> triangle_map, const StripsOfCell& strips,
                 Deviation& deviation, FaceBounds& bounds, std::vector<float>& given_bound) {
    const Mesh before = withStrips(below, strips.taken);
    FaceBounds before_bounds = std::move(bounds);
    before_bounds.to_original.resize(before.triangleCount(), 0);
    for (const float bound : strips.taken_bound) before_bounds.from_original.push_back(bound);
    DeviationInput step;
    step.before = &before;
    step.before_bounds = &before_bounds;
    step.triangle_map = triangle_map;
    const std::vector<uint8_t> changed = changedTriangles(below, layer, triangle_map);
    step.triangle_changed = changed;
    step.child_error = error;
    step.before_takes = uint32_t(strips.taken.triangleCount());
    given_bound.assign(strips.given.triangleCount(), -1);
    // Whatever a strip saves is no more than its height.
    std::vector<size_t> given;
    for (size_t i = 0; i < given_bound.size(); ++i)
        if (heightOf(strips.given, i) > error) given.push_back(i);
    Mesh offered;
    offered.position = strips.given.position;
    for (const size_t i : given) offered.triangle.push_back(strips.given.triangle[i]);
    const Mesh after = withStrips(layer, offered);
    const auto faces = uint32_t(layer.triangleCount());
    step.after = &after;
    step.after_takes = uint32_t(given.size());
    step.worth = [&](uint32_t f, float value, float result) {
        const float height = heightOf(strips.given, given[f - faces]);
        return value <= std::max(kSmallPart * std::max(result, error), height);
    };
    deviation.run(step, bounds);
    for (size_t i = 0; i < given.size(); ++i) given_bound[given[i]] = bounds.to_original[faces + i];
    bounds.to_original.resize(faces);
    bounds.from_original.resize(faces);
    return largestOf(bounds, error);
}

float takeStrips(const Mesh& taken, std::span<const float> given_bound, const Mesh& layer,
                 float error, FaceBounds& bounds) {
    Mesh strips;
    std::vector<float> base;
    for (size_t i = 0; i < given_bound.size(); ++i) {
        if (given_bound[i] < 0) continue;
        strips.triangle.push_back(taken.triangle[i]);
        base.push_back(given_bound[i]);
    }
    if (base.empty()) return error;
    strips.position = taken.position;
    coverStrips(strips, layer, base, {}, error, bounds.to_original, true);
    return largestOf(bounds, error);
}

std::vector<float> boundStrips(const Mesh& strips, const Mesh& below, float error,
                               const FaceBounds& bounds) {
    std::vector<float> value(strips.triangleCount(), 0);
    if (value.empty()) return value;
    KeyMap near;
    near.reserve(strips.vertexCount());
    for (const Vec3i& p : strips.position) near.insert(latticeKey(p), 0);
    std::vector<uint8_t> is_near;
    for (const Vec3i& p : below.position) is_near.push_back(near.find(latticeKey(p)) != nullptr);
    Mesh around;
    around.position = below.position;
    std::vector<float> from_original;
    for (size_t t = 0; t < below.triangleCount(); ++t) {
        const auto& [a, b, c] = below.triangle[t];
        if (!is_near[a] && !is_near[b] && !is_near[c]) continue;
        around.triangle.push_back(below.triangle[t]);
        from_original.push_back(bounds.from_original[t]);
    }
    coverStrips(strips, around, {}, from_original, error, value, false);
    return value;
}

}  // namespace pietra::cluster
