#include "methods/cluster/layers.h"

#include <algorithm>
#include <cmath>
#include <unordered_set>

#include "base/check.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "geometry/lattice.h"
#include "methods/cluster/anchors.h"
#include "methods/cluster/octree_cells.h"
#include "simplify/deviation.h"
#include "simplify/deviation_direction.h"

namespace pietra::cluster {

namespace {

/// Layer 0 of a cell.
PolygonMesh cellMesh(const Mesh& model, std::span<const uint32_t> triangles,
                     const Interfaces& interfaces) {
    Mesh mesh;
    std::vector<uint32_t> names;
    for (const uint32_t t : triangles)
        for (const uint32_t v : model.triangle[t]) names.push_back(v);
    std::sort(names.begin(), names.end());
    names.erase(std::unique(names.begin(), names.end()), names.end());
    std::vector<uint8_t> at_interface, irregular;
    for (const uint32_t v : names) {
        mesh.position.push_back(model.position[v]);
        at_interface.push_back(interfaces.atInterface()[v]);
        irregular.push_back(interfaces.irregular()[v]);
    }
    for (const uint32_t t : triangles) {
        Triangle local;
        for (size_t k = 0; k < 3; ++k)
            local[k] = uint32_t(std::lower_bound(names.begin(), names.end(), model.triangle[t][k]) -
                                names.begin());
        mesh.triangle.push_back(local);
        mesh.edge_class.push_back(model.edge_class[t]);
    }
    return polygonsOf(mesh, names, at_interface, irregular);
}

/// Lattice points that are no vertices.
class FreePoints {
public:
    explicit FreePoints(const std::vector<Vec3i>& vertices) : vertices_(vertices) {}
    /// Near another one, and none given before.
    Vec3i near(const Vec3i& wanted) {
        if (taken_.empty())
            for (const Vec3i& p : vertices_) taken_.insert(latticeKey(p));
        for (int32_t reach = 0;; ++reach)
            for (int32_t x = -reach; x <= reach; ++x)
                for (int32_t y = -reach; y <= reach; ++y)
                    for (int32_t z = -reach; z <= reach; ++z) {
                        const Vec3i p =
                            glm::clamp(wanted + Vec3i(x, y, z), Vec3i(0), Vec3i(kLatticeMax));
                        if (taken_.insert(latticeKey(p)).second) return p;
                    }
    }

private:
    const std::vector<Vec3i>& vertices_;
    std::unordered_set<uint64_t> taken_;  // filled when it is first asked for
};

/// `super_face`: of each face below, its face in the result.
PolygonMesh nextLayer(const PolygonMesh& below, std::span<const uint8_t> removed,
                      uint32_t faces_each, const ClusterSettings& settings,
                      std::vector<uint32_t>& super_face) {
    const Groups fans = fansWithout(below, removed);
    std::vector<uint8_t> stays;
    for (const uint32_t name : below.name) stays.push_back(!removed[name]);
    const PolygonMesh polygons = mergeFaces(below, fans, stays);
    const Groups groups = clusterFaces(polygons, below.faceCount() / faces_each, settings);
    super_face.clear();
    for (const uint32_t fan : fans.of_face) super_face.push_back(groups.of_face[fan]);
    return mergeFaces(polygons, groups, findAnchors(polygons, groups));
}

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

/// The bounds of a cell's layer, from those below.
void boundLayer(CellLayers& cell, std::span<const uint32_t> super_face, FaceBounds& bounds,
                Deviation& deviation) {
    const LayerTriangles& layer = cell.layer.back();
    if (cell.layer.size() == 1) {
        bounds.to_original.assign(layer.mesh.triangleCount(), 0);
        bounds.from_original = bounds.to_original;
        cell.error.push_back(0);
        return;
    }
    const LayerTriangles& below = cell.layer[cell.layer.size() - 2];
    const std::vector<uint32_t> map = triangleMap(below, layer, super_face);
    DeviationInput step;
    step.before = &below.mesh;
    step.before_bounds = &bounds;
    step.after = &layer.mesh;
    step.triangle_map = map;
    step.child_error = cell.error.back();
    FaceBounds after;
    const float error = deviation.run(step, after);
    bounds = std::move(after);
    cell.error.push_back(std::max(error, cell.error.back()));
}

/// Bounds of the strips' distance to layer 0 by what a cell has below the layer at which they
/// appear: by the first of a strip's cells and by the second.
void boundStrips(const LayeredPiece& piece, std::span<const Strip> strips, uint32_t cell,
                 const FaceBounds& below, std::array<std::vector<float>, 2>& bound) {
    std::vector<size_t> own;
    Mesh mesh;
    for (size_t i = 0; i < strips.size(); ++i) {
        if (strips[i].cells[0] != cell && strips[i].cells[1] != cell) continue;
        own.push_back(i);
        const uint32_t base = uint32_t(mesh.position.size());
        for (const uint32_t v : {strips[i].before, strips[i].removed, strips[i].after})
            mesh.position.push_back(piece.position[v]);
        mesh.triangle.push_back({base, base + 1, base + 2});
    }
    if (own.empty()) return;
    deviation::Surface source, target;
    source.assign(mesh);
    target.assign(piece.cell[cell].layer.back().mesh);
    std::vector<float> value(own.size(), 0);
    deviation::Direction direction;
    deviation::Progressing progress{piece.cell[cell].error.back(), 0};
    direction.begin(source, target, {}, below.from_original, value, false);
    for (uint32_t t = 0; t < own.size(); ++t) {
        const Vec3f origin = source.corner(t, 0);
        const Vec3f middle = (source.corner(t, 1) - origin + source.corner(t, 2) - origin) / 3.0f;
        direction.cover(t, target.nearest(origin, middle, {}, {0, HUGE_VALF}).face, progress);
    }
    direction.finish(progress);
    for (size_t i = 0; i < own.size(); ++i)
        bound[strips[own[i]].cells[0] == cell ? 0 : 1][own[i]] = value[i];
}

/// For both cells of a strip, the better of its two bounds counts.
void addStrips(LayeredPiece& piece, std::span<const Strip> strips,
               const std::array<std::vector<float>, 2>& bound) {
    for (size_t i = 0; i < strips.size(); ++i)
        for (const uint32_t c : strips[i].cells) {
            float& error = piece.cell[c].error.back();
            error = std::max(error, std::min(bound[0][i], bound[1][i]));
        }
}

void append(Mesh& to, const Mesh& from) {
    const uint32_t base = uint32_t(to.position.size());
    to.position.insert(to.position.end(), from.position.begin(), from.position.end());
    for (const auto& [a, b, c] : from.triangle)
        to.triangle.push_back({base + a, base + b, base + c});
    to.edge_class.insert(to.edge_class.end(), from.edge_class.begin(), from.edge_class.end());
}

}  // namespace

LayeredPiece buildLayers(const Mesh& mesh, const LayerSettings& settings) {
    const Stopwatch watch;
    const CellTriangles cells = octreeCells(mesh, settings.cell_vertices);
    const double seconds = watch.seconds();
    LayeredPiece piece = buildLayers(mesh, cells, settings);
    piece.seconds.cells += seconds;
    return piece;
}

LayeredPiece buildLayers(const Mesh& mesh, const CellTriangles& cells,
                         const LayerSettings& settings) {
    LayeredPiece piece{mesh.position, {}, {}, settings.layers, {}};
    Stopwatch watch;
    const auto spend = [&](double& seconds) { seconds += 1e-3 * watch.lapMs(); };
    Interfaces interfaces(mesh, cells);
    const size_t count = cells.of_cell.size();
    std::vector<PolygonMesh> current(count);
    std::vector<std::vector<uint32_t>> super_face(count);
    std::vector<FaceBounds> bounds(count);
    PerThread<Deviation> deviation;
    std::span<const Strip> strips;  // those of the layer in work
    std::array<std::vector<float>, 2> strip_bound;
    parallelFor(count,
                [&](size_t c) { current[c] = cellMesh(mesh, cells.of_cell[c], interfaces); });
    spend(piece.seconds.cells);
    piece.cell.resize(count);
    FreePoints free_points(mesh.position);
    for (uint16_t layer = 0;; ++layer) {
        parallelFor(count,
                    [&](size_t c) { piece.cell[c].layer.push_back(triangulate(current[c])); });
        for (CellLayers& cell : piece.cell)
            for (const uint32_t v : cell.layer.back().to_free)
                cell.layer.back().mesh.position[v] =
                    free_points.near(cell.layer.back().mesh.position[v]);
        spend(piece.seconds.triangles);
        parallelFor(count, [&](size_t c) {
            boundLayer(piece.cell[c], super_face[c], bounds[c], deviation.local());
        });
        addStrips(piece, strips, strip_bound);
        spend(piece.seconds.errors);
        if (layer == settings.layers) return piece;
        interfaces.removeFor(uint16_t(layer + 1), current);
        const size_t had = piece.strips.size();
        piece.strips = interfaces.strips();
        strips = std::span(piece.strips).subspan(had);
        for (auto& side : strip_bound) side.assign(strips.size(), 0);
        parallelFor(count, [&](size_t c) {
            boundStrips(piece, strips, uint32_t(c), bounds[c], strip_bound);
        });
        spend(piece.seconds.interfaces);
        const uint32_t faces_each = layer == 0 ? settings.first_faces : settings.faces;
        parallelFor(count, [&](size_t c) {
            current[c] = nextLayer(current[c], interfaces.justRemoved(), faces_each,
                                   settings.clustering, super_face[c]);
        });
        spend(piece.seconds.faces);
    }
}

Mesh mixedMesh(const LayeredPiece& piece, std::span<const uint16_t> layer_of_cell,
               bool with_strips) {
    Mesh mixed;
    for (size_t c = 0; c < piece.cell.size(); ++c)
        append(mixed, piece.cell[c].layer[layer_of_cell[c]].mesh);
    if (!with_strips) return mixed;
    for (const Strip& strip : piece.strips) {
        const uint16_t first = layer_of_cell[strip.cells[0]],
                       second = layer_of_cell[strip.cells[1]];
        if ((first < strip.layer) == (second < strip.layer)) continue;
        // The first cell's outline goes from `before` to `after`.
        const bool first_is_fine = first < strip.layer;
        const uint32_t a = first_is_fine ? strip.before : strip.after;
        const uint32_t b = first_is_fine ? strip.after : strip.before;
        Mesh triangle;
        triangle.position = {piece.position[a], piece.position[b], piece.position[strip.removed]};
        triangle.triangle = {{0, 1, 2}};
        triangle.edge_class = {0};
        append(mixed, triangle);
    }
    return mixed;
}

}  // namespace pietra::cluster
