#include "methods/cluster/cell_layer.h"

#include <algorithm>
#include <numeric>
#include <unordered_map>

#include "base/disjoint_sets.h"
#include "base/state.h"
#include "coarsen/mesh_joiner.h"

namespace pietra::cluster {

namespace {

using Pair = std::array<uint32_t, 2>;

/// By their edges, and where no other cell uses them by their fans: the cell has all of these.
void markIrregular(PolygonMesh& mesh) {
    DisjointSets fans(mesh.halfEdgeCount());  // of corners
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        const uint32_t a = mesh.corner[h], b = mesh.end(h);
        if (const uint32_t t = mesh.twin[h]; t != kNone) {
            fans.unite(h, mesh.next(t));
            continue;
        }
        const EdgeClass edge_class = mesh.edge_class[h];
        const bool at_interface = mesh.interface_[a] && mesh.interface_[b];
        if (edge_class != EdgeClass::kBorder &&
            !(edge_class == EdgeClass::kManifold && at_interface))
            mesh.irregular[a] = mesh.irregular[b] = 1;
    }
    std::vector<uint32_t> fan(mesh.vertexCount(), kNone);
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        uint32_t& at = fan[mesh.corner[h]];
        if (at != kNone && at != fans.root(h) && !mesh.interface_[mesh.corner[h]])
            mesh.irregular[mesh.corner[h]] = 1;
        at = fans.root(h);
    }
}

/// Half-edges of different children that run along each other.
void stitch(PolygonMesh& mesh) {
    const auto key = [](uint32_t a, uint32_t b) { return uint64_t(a) << 32 | b; };
    const auto isOpen = [&](uint32_t h) {
        return mesh.twin[h] == kNone && mesh.edge_class[h] == EdgeClass::kManifold;
    };
    std::unordered_map<uint64_t, uint32_t> open;
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h)
        if (isOpen(h)) open.emplace(key(mesh.corner[h], mesh.end(h)), h);
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        if (!isOpen(h)) continue;
        const auto other = open.find(key(mesh.end(h), mesh.corner[h]));
        if (other == open.end()) continue;
        mesh.twin[h] = other->second;
        mesh.twin[other->second] = h;
    }
}

}  // namespace

void appendVertex(const Mesh& from, uint32_t v, Mesh& to) {
    copyVertex(from, v, to);
}

namespace {

/// Polygons and pairs of what `triangles` are of a leaf: all of them, or those at its interfaces.
CellLayer polygonsOfLeaf(const Mesh& mesh, std::span<const uint32_t> number,
                         std::span<const uint8_t> at_interface) {
    CellLayer out;
    std::vector<uint32_t> names(mesh.vertexCount());
    std::iota(names.begin(), names.end(), 0u);
    out.polygons =
        polygonsOf(mesh, names, at_interface, std::vector<uint8_t>(mesh.vertexCount(), 0));
    markIrregular(out.polygons);
    for (const auto& [a, b, c] : mesh.triangle)
        for (const auto& [v, w] : {Pair{a, b}, Pair{b, c}, Pair{c, a}})
            if (at_interface[v] && at_interface[w])
                out.joined.push_back(
                    {std::min(number[v], number[w]), std::max(number[v], number[w])});
    std::sort(out.joined.begin(), out.joined.end());
    out.joined.erase(std::unique(out.joined.begin(), out.joined.end()), out.joined.end());
    return out;
}

/// Of each vertex of a leaf, its number in the table and whether other cells use it.
struct LeafVertices {
    LeafVertices(const Mesh& mesh, CellId cell, const Octree& octree, const InterfaceTable& table)
        : number(mesh.vertexCount()), at_interface(mesh.vertexCount()) {
        const int layer = octree.firstLayer(cell);
        for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
            number[v] = table.find(mesh.position[v]);
            at_interface[v] = number[v] != kNone && table.cellsAt(number[v], layer).count > 1;
        }
    }
    std::vector<uint32_t> number;
    std::vector<uint8_t> at_interface;
};

}  // namespace

CellLayer firstLayer(const CellMesh& leaf, float error, CellId cell, const Octree& octree,
                     const InterfaceTable& table) {
    const Mesh& mesh = leaf.mesh;
    const LeafVertices vertices(mesh, cell, octree, table);
    CellLayer out = polygonsOfLeaf(mesh, vertices.number, vertices.at_interface);
    out.triangles.mesh = mesh;
    out.triangles.face.resize(mesh.triangleCount());
    std::iota(out.triangles.face.begin(), out.triangles.face.end(), 0u);
    out.bounds = leaf.bounds;
    out.error = error;
    out.closed = leaf.closed;
    return out;
}

CellLayer interfacesOfLeaf(const CellMesh& leaf, CellId cell, const Octree& octree,
                           const InterfaceTable& table) {
    const LeafVertices vertices(leaf.mesh, cell, octree, table);
    Mesh part;
    part.position = leaf.mesh.position;
    for (size_t t = 0; t < leaf.mesh.triangleCount(); ++t) {
        const auto& [a, b, c] = leaf.mesh.triangle[t];
        const auto& at = vertices.at_interface;
        if (!at[a] && !at[b] && !at[c]) continue;
        part.triangle.push_back(leaf.mesh.triangle[t]);
        part.edge_class.push_back(leaf.mesh.edge_class[t]);
    }
    return polygonsOfLeaf(part, vertices.number, vertices.at_interface);
}

CellLayer joinLayers(std::span<const CellLayer> below, int layer, const InterfaceTable& table) {
    CellLayer out;
    out.closed = true;
    PolygonMesh& to = out.polygons;
    Mesh& mesh = out.triangles.mesh;
    size_t vertices = 0;
    for (const CellLayer& child : below) vertices += child.polygons.vertexCount();
    MeshJoiner joiner;
    joiner.begin(mesh, vertices);
    std::vector<std::vector<uint32_t>> vertex_of(below.size());
    for (size_t c = 0; c < below.size(); ++c) {
        const PolygonMesh& from = below[c].polygons;
        for (uint32_t v = 0; v < from.vertexCount(); ++v) {
            const uint32_t w = joiner.addVertex(below[c].triangles.mesh, v);
            vertex_of[c].push_back(w);
            if (w == to.vertexCount()) {
                to.position.push_back(from.position[v]);
                to.name.push_back(w);
                to.interface_.push_back(from.interface_[v]);
                to.irregular.push_back(0);
            }
            to.irregular[w] |= from.irregular[v];
        }
    }
    const uint32_t own = to.vertexCount();
    for (size_t c = 0; c < below.size(); ++c) {
        const CellLayer& child = below[c];
        const PolygonMesh& from = child.polygons;
        const uint32_t first_half = to.halfEdgeCount(), first_face = to.faceCount();
        const uint32_t first_inner = uint32_t(to.inner_name.size());
        for (uint32_t f = 0; f < from.faceCount(); ++f) {
            to.face_begin.push_back(first_half + from.face_begin[f + 1]);
            to.shape.push_back(from.shape[f]);
            to.middle.push_back(from.middle[f] == kNone ? kNone : first_inner + from.middle[f]);
        }
        for (uint32_t h = 0; h < from.halfEdgeCount(); ++h) {
            to.corner.push_back(vertex_of[c][from.corner[h]]);
            to.face.push_back(first_face + from.face[h]);
            to.twin.push_back(from.twin[h] == kNone ? kNone : first_half + from.twin[h]);
            to.edge_class.push_back(from.edge_class[h]);
        }
        for (uint32_t i = 0; i < from.inner_name.size(); ++i) {
            to.inner_position.push_back(from.inner_position[i]);
            to.inner_name.push_back(own + first_inner + i);
            appendVertex(child.inner, i, out.inner);
        }
        // Triangles, with the vertices that are no polygon's.
        std::vector<uint32_t>& vertex = vertex_of[c];
        const Mesh& triangles = child.triangles.mesh;
        for (uint32_t v = from.vertexCount(); v < triangles.vertexCount(); ++v) {
            vertex.push_back(uint32_t(mesh.vertexCount()));
            appendVertex(triangles, v, mesh);
        }
        for (const auto& [i, j, k] : triangles.triangle)
            mesh.triangle.push_back({vertex[i], vertex[j], vertex[k]});
        mesh.edge_class.insert(mesh.edge_class.end(), triangles.edge_class.begin(),
                               triangles.edge_class.end());
        for (const uint32_t f : child.triangles.face) out.triangles.face.push_back(first_face + f);
        const auto append = [](std::vector<float>& values, const std::vector<float>& more) {
            values.insert(values.end(), more.begin(), more.end());
        };
        append(out.bounds.to_original, child.bounds.to_original);
        append(out.bounds.from_original, child.bounds.from_original);
        out.error = std::max(out.error, child.error);
        out.closed = out.closed && child.closed;
    }
    stitch(to);
    for (const CellLayer& child : below)
        out.joined.insert(out.joined.end(), child.joined.begin(), child.joined.end());
    std::sort(out.joined.begin(), out.joined.end());
    out.joined.erase(std::unique(out.joined.begin(), out.joined.end()), out.joined.end());
    continueLayer(out, layer, table);
    return out;
}

void continueLayer(CellLayer& cell, int layer, const InterfaceTable& table) {
    const auto isShared = [&](uint32_t number) { return table.cellsAt(number, layer).count > 1; };
    PolygonMesh& polygons = cell.polygons;
    bool changed = false;
    for (uint32_t v = 0; v < polygons.vertexCount(); ++v)
        if (polygons.interface_[v] && !isShared(table.find(polygons.position[v]))) {
            polygons.interface_[v] = 0;
            changed = true;
        }
    if (!changed) return;
    markIrregular(polygons);
    std::erase_if(cell.joined,
                  [&](const Pair& pair) { return !isShared(pair[0]) || !isShared(pair[1]); });
}

CellLayer carryOver(const CellLayer& below, PolygonMesh polygons, LayerTriangles triangles) {
    CellLayer out;
    const uint32_t had = below.polygons.vertexCount();
    const auto append = [&](uint32_t name, Mesh& to) {
        if (name < had)
            appendVertex(below.triangles.mesh, name, to);
        else
            appendVertex(below.inner, name - had, to);
    };
    // Of the triangles' vertices that are no polygon's: whose centre they are.
    const uint32_t count = polygons.vertexCount();
    std::vector<uint32_t> face_of(triangles.mesh.vertexCount() - count, 0);
    for (size_t t = 0; t < triangles.mesh.triangleCount(); ++t)
        for (const uint32_t v : triangles.mesh.triangle[t])
            if (v >= count) face_of[v - count] = triangles.face[t];
    Mesh carried;
    for (uint32_t v = 0; v < count; ++v) append(polygons.name[v], carried);
    for (const uint32_t f : face_of) {
        const uint32_t middle = polygons.middle[f];
        append(middle != kNone ? polygons.inner_name[middle]
                               : polygons.name[polygons.corner[polygons.face_begin[f]]],
               carried);
    }
    carried.position = std::move(triangles.mesh.position);  // free points have their own
    carried.triangle = std::move(triangles.mesh.triangle);
    carried.edge_class = std::move(triangles.mesh.edge_class);
    triangles.mesh = std::move(carried);
    for (uint32_t& name : polygons.inner_name) append(name, out.inner);
    std::iota(polygons.name.begin(), polygons.name.end(), 0u);
    std::iota(polygons.inner_name.begin(), polygons.inner_name.end(), count);
    out.polygons = std::move(polygons);
    out.triangles = std::move(triangles);
    out.closed = below.closed;
    return out;
}

namespace {

/// The same list for both ways.
template <class Layer, class Visit>
void forEachArray(Layer& layer, Visit&& visit) {
    auto& p = layer.polygons;
    visit(p.position), visit(p.name), visit(p.interface_), visit(p.irregular), visit(p.face_begin);
    visit(p.shape), visit(p.middle), visit(p.corner), visit(p.face), visit(p.twin);
    visit(p.edge_class), visit(p.inner_position), visit(p.inner_name);
    visit(layer.triangles.face), visit(layer.bounds.to_original);
    visit(layer.bounds.from_original), visit(layer.joined);
    for (auto* mesh : {&layer.triangles.mesh, &layer.inner}) {
        visit(mesh->position), visit(mesh->triangle), visit(mesh->edge_class);
        visit(mesh->normal), visit(mesh->colour), visit(mesh->scalar);
    }
}

}  // namespace

std::vector<std::byte> packLayer(const CellLayer& layer) {
    StateWriter writer;
    writer.put(layer.error);
    writer.put(layer.closed);
    forEachArray(layer, [&](const auto& values) { writer.put(values); });
    return {writer.bytes().begin(), writer.bytes().end()};
}

CellLayer unpackLayer(std::vector<std::byte> bytes) {
    StateReader reader(std::move(bytes));
    CellLayer layer;
    reader.get(layer.error);
    reader.get(layer.closed);
    forEachArray(layer, [&](auto& values) { reader.get(values); });
    return layer;
}

}  // namespace pietra::cluster
