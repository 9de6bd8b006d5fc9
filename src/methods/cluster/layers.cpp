#include "methods/cluster/layers.h"

#include <algorithm>
#include <unordered_set>

#include "base/check.h"
#include "base/parallel.h"
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
    explicit FreePoints(const std::vector<Vec3i>& taken) {
        for (const Vec3i& p : taken) taken_.insert(latticeKey(p));
    }
    Vec3i near(const Vec3i& wanted) {
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
    std::unordered_set<uint64_t> taken_;
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
    const CellTriangles cells = octreeCells(mesh, settings.cell_vertices);
    Interfaces interfaces(mesh, cells);
    FreePoints points(mesh.position);
    const FreePoint free_point = [&points](const Vec3i& p) { return points.near(p); };
    LayeredPiece piece{
        mesh.position, std::vector<CellLayers>(cells.of_cell.size()), {}, settings.layers};
    std::vector<PolygonMesh> current(cells.of_cell.size());
    parallelFor(current.size(),
                [&](size_t c) { current[c] = cellMesh(mesh, cells.of_cell[c], interfaces); });
    const auto storeLayer = [&] {
        for (size_t c = 0; c < current.size(); ++c)
            piece.cell[c].layer.push_back(triangulate(current[c], free_point));
    };
    storeLayer();
    for (uint16_t layer = 1; layer <= settings.layers; ++layer) {
        interfaces.removeFor(layer, current);
        const uint32_t faces_each = layer == 1 ? settings.first_faces : settings.faces;
        parallelFor(current.size(), [&](size_t c) {
            current[c] =
                nextLayer(current[c], interfaces.justRemoved(), faces_each, settings.clustering);
        });
        storeLayer();
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
