#include "methods/cluster/fallback.h"

#include <algorithm>

#include "base/disjoint_sets.h"

namespace pietra::cluster {

namespace {

struct Component {
    double area = 0;
    size_t triangles = 0;
    bool stays = false;
};

/// A number for each face: the least of those that hang together over vertices.
std::vector<uint32_t> componentsOf(const PolygonMesh& mesh) {
    DisjointSets sets(mesh.faceCount());
    std::vector<uint32_t> first(mesh.vertexCount(), kNone);
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        uint32_t& at = first[mesh.corner[h]];
        if (at == kNone) at = mesh.face[h];
        sets.unite(at, mesh.face[h]);
    }
    std::vector<uint32_t> roots;
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) roots.push_back(sets.root(f));
    return roots;
}

/// `new_face`: of those that stay, increasing; else kNone. Whole components.
PolygonMesh keepFaces(const PolygonMesh& mesh, std::span<const uint32_t> new_face) {
    PolygonMesh out;
    std::vector<uint32_t> new_vertex(mesh.vertexCount(), kNone), new_half(mesh.halfEdgeCount());
    for (uint32_t h = 0, count = 0; h < mesh.halfEdgeCount(); ++h)
        if (new_face[mesh.face[h]] != kNone) new_half[h] = count++;
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) {
        if (new_face[f] == kNone) continue;
        for (uint32_t h = mesh.face_begin[f]; h < mesh.face_begin[f + 1]; ++h) {
            const uint32_t v = mesh.corner[h];
            if (new_vertex[v] == kNone) {
                new_vertex[v] = out.vertexCount();
                out.position.push_back(mesh.position[v]);
                out.name.push_back(mesh.name[v]);
                out.interface_.push_back(mesh.interface_[v]);
                out.irregular.push_back(mesh.irregular[v]);
            }
            out.corner.push_back(new_vertex[v]);
            out.face.push_back(new_face[f]);
            out.twin.push_back(mesh.twin[h] == kNone ? kNone : new_half[mesh.twin[h]]);
            out.edge_class.push_back(mesh.edge_class[h]);
        }
        out.face_begin.push_back(out.halfEdgeCount());
        out.shape.push_back(mesh.shape[f]);
        const uint32_t middle = mesh.middle[f];
        out.middle.push_back(middle == kNone ? kNone : uint32_t(out.inner_name.size()));
        if (middle == kNone) continue;
        out.inner_position.push_back(mesh.inner_position[middle]);
        out.inner_name.push_back(mesh.inner_name[middle]);
    }
    return out;
}

}  // namespace

void dropComponents(LayerStep& step, size_t most) {
    const PolygonMesh& mesh = step.polygons;
    const std::vector<uint32_t> component_of = componentsOf(mesh);
    std::vector<Component> components(mesh.faceCount());
    for (uint32_t f = 0; f < mesh.faceCount(); ++f)
        components[component_of[f]].area += mesh.shape[f].area;
    for (const uint32_t f : step.triangles.face) ++components[component_of[f]].triangles;
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h)
        if (mesh.interface_[mesh.corner[h]]) components[component_of[mesh.face[h]]].stays = true;
    std::vector<std::pair<double, uint32_t>> order;
    for (uint32_t c = 0; c < components.size(); ++c)
        if (components[c].triangles > 0 && !components[c].stays)
            order.push_back({components[c].area, c});
    std::sort(order.begin(), order.end());
    const bool all_may_go = std::none_of(components.begin(), components.end(),
                                         [](const Component& c) { return c.stays; });
    if (all_may_go) order.pop_back();
    std::vector<uint8_t> goes(components.size(), 0);
    size_t left = step.triangles.mesh.triangleCount();
    for (const auto& [area, c] : order) {
        if (left <= most) break;
        goes[c] = 1;
        left -= components[c].triangles;
    }
    std::vector<uint32_t> new_face(mesh.faceCount(), kNone);
    uint32_t count = 0;
    for (uint32_t f = 0; f < mesh.faceCount(); ++f)
        if (!goes[component_of[f]]) new_face[f] = count++;
    if (count == mesh.faceCount()) return;
    std::vector<uint32_t> face_before = std::move(step.triangles.face);
    step.polygons = keepFaces(mesh, new_face);
    step.triangles = triangulate(step.polygons);
    std::vector<uint32_t> first(count, kNone);
    for (uint32_t t = 0; t < step.triangles.face.size(); ++t)
        first[step.triangles.face[t]] = std::min(first[step.triangles.face[t]], t);
    for (uint32_t& t : step.triangle_map) {
        const uint32_t f = new_face[face_before[t]];
        t = f == kNone ? kNoDeviationIndex : first[f];
    }
}

}  // namespace pietra::cluster
