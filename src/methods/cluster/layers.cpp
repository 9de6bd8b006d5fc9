#include "methods/cluster/layers.h"

#include <algorithm>
#include <unordered_set>

#include "base/check.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "geometry/lattice.h"
#include "methods/cluster/anchors.h"
#include "methods/cluster/octree_cells.h"

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

PolygonMesh nextLayer(const PolygonMesh& below, std::span<const uint8_t> removed,
                      uint32_t faces_each, const ClusterSettings& settings) {
    const PolygonMesh polygons = withoutRemoved(below, removed);
    const Groups groups = clusterFaces(polygons, below.faceCount() / faces_each, settings);
    return mergeFaces(polygons, groups, findAnchors(polygons, groups));
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
    LayeredPiece piece{mesh.position, {}, {}, settings.layers, {}};
    Stopwatch watch;
    const auto spend = [&](double& seconds) { seconds += 1e-3 * watch.lapMs(); };
    const CellTriangles cells = octreeCells(mesh, settings.cell_vertices);
    Interfaces interfaces(mesh, cells);
    const size_t count = cells.of_cell.size();
    std::vector<PolygonMesh> current(count);
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
        if (layer == settings.layers) break;
        interfaces.removeFor(uint16_t(layer + 1), current);
        spend(piece.seconds.interfaces);
        const uint32_t faces_each = layer == 0 ? settings.first_faces : settings.faces;
        parallelFor(count, [&](size_t c) {
            current[c] =
                nextLayer(current[c], interfaces.justRemoved(), faces_each, settings.clustering);
        });
        spend(piece.seconds.faces);
    }
    piece.strips = interfaces.strips();
    return piece;
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
