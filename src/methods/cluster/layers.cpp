#include "methods/cluster/layers.h"

#include <algorithm>

#include "base/check.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "geometry/lattice.h"
#include "methods/cluster/free_points.h"
#include "methods/cluster/layer_step.h"
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
    const CellLayers& layers = piece.cell[cell];
    const std::vector<float> value =
        cluster::boundStrips(mesh, layers.layer.back().mesh, layers.error.back(), below);
    for (size_t i = 0; i < own.size(); ++i)
        bound[strips[own[i]].cells[0] == cell ? 0 : 1][own[i]] = value[i];
}

/// A cell's strips and where they are in the list.
struct ListedStrips : StripsOfCell {
    std::vector<size_t> given_at, taken_at;
};

/// Who is nearer to a strip gives it.
ListedStrips stripsOf(const LayeredPiece& piece, std::span<const Strip> strips, uint32_t cell,
                      const std::array<std::vector<float>, 2>& bound) {
    ListedStrips own;
    for (size_t i = 0; i < strips.size(); ++i) {
        const Strip& strip = strips[i];
        if (strip.cells[0] != cell && strip.cells[1] != cell) continue;
        const bool first = strip.cells[0] == cell, gives = first == (bound[0][i] < bound[1][i]);
        Mesh& mesh = gives ? own.given : own.taken;
        const uint32_t base = uint32_t(mesh.position.size());
        for (const uint32_t v : {strip.before, strip.removed, strip.after})
            mesh.position.push_back(piece.position[v]);
        if (first == gives)
            mesh.triangle.push_back({base, base + 1, base + 2});
        else
            mesh.triangle.push_back({base + 2, base + 1, base});
        (gives ? own.given_at : own.taken_at).push_back(i);
        if (!gives) own.taken_bound.push_back(std::min(bound[0][i], bound[1][i]));
    }
    return own;
}

/// For both cells of a strip, the better of its two bounds counts.
void addStrips(LayeredPiece& piece, std::span<const Strip> strips,
               const std::array<std::vector<float>, 2>& bound, std::span<const float> given) {
    for (size_t i = 0; i < strips.size(); ++i)
        for (const uint32_t c : strips[i].cells) {
            float& error = piece.cell[c].error.back();
            error = std::max({error, std::min(bound[0][i], bound[1][i]), given[i]});
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
    std::vector<LayerStep> step(count);
    std::vector<FaceBounds> bounds(count);
    PerThread<Deviation> deviation;
    std::array<std::vector<float>, 2> strip_bound;
    const Box3i room{Vec3i(0), Vec3i(kLatticeMax)};
    FreePoints free_points(room, 0);
    free_points.occupy(mesh.position);
    piece.cell.resize(count);
    parallelFor(count, [&](size_t c) {
        current[c] = cellMesh(mesh, cells.of_cell[c], interfaces);
        piece.cell[c].layer.push_back(triangulate(current[c]));
        piece.cell[c].error.push_back(0);
        bounds[c].to_original.assign(piece.cell[c].layer[0].mesh.triangleCount(), 0);
        bounds[c].from_original = bounds[c].to_original;
    });
    spend(piece.seconds.cells);
    for (uint16_t layer = 1; layer <= settings.layers; ++layer) {
        interfaces.removeFor(layer, current);
        const size_t had = piece.strips.size();
        piece.strips = interfaces.strips();
        const std::span<const Strip> strips = std::span(piece.strips).subspan(had);
        for (auto& side : strip_bound) side.assign(strips.size(), 0);
        parallelFor(count, [&](size_t c) {
            boundStrips(piece, strips, uint32_t(c), bounds[c], strip_bound);
        });
        spend(piece.seconds.interfaces);
        const uint32_t faces_each = layer == 1 ? settings.first_faces : settings.faces;
        parallelFor(count, [&](size_t c) {
            step[c] = nextLayer(current[c], piece.cell[c].layer.back(), interfaces.justRemoved(),
                                faces_each, room, settings.clustering);
        });
        for (size_t c = 0; c < count; ++c) {
            free_points.settle(step[c]);
            free_points.placeStars(step[c].triangles);
            current[c] = std::move(step[c].polygons);
        }
        spend(piece.seconds.faces);
        std::vector<ListedStrips> own(count);
        std::vector<float> given(strips.size(), -1);
        parallelFor(count, [&](size_t c) {
            CellLayers& cell = piece.cell[c];
            own[c] = stripsOf(piece, strips, uint32_t(c), strip_bound);
            std::vector<float> value;
            cell.error.push_back(boundLayer(cell.layer.back().mesh, cell.error.back(),
                                            step[c].triangles.mesh, step[c].triangle_map, own[c],
                                            deviation.local(), bounds[c], value));
            for (size_t i = 0; i < value.size(); ++i) given[own[c].given_at[i]] = value[i];
            cell.layer.push_back(std::move(step[c].triangles));
        });
        parallelFor(count, [&](size_t c) {
            std::vector<float> value;
            for (const size_t i : own[c].taken_at) value.push_back(given[i]);
            float& error = piece.cell[c].error.back();
            error =
                takeStrips(own[c].taken, value, piece.cell[c].layer.back().mesh, error, bounds[c]);
        });
        addStrips(piece, strips, strip_bound, given);
        spend(piece.seconds.errors);
    }
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
