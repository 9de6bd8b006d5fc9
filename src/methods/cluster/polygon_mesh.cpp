#include "methods/cluster/polygon_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>

#include "base/check.h"

namespace pietra::cluster {

namespace {

FaceShape shapeOf(const Vec3i& a, const Vec3i& b, const Vec3i& c) {
    FaceShape shape;
    const Vec3l cross = crossInteger(Vec3l(b - a), Vec3l(c - a));
    shape.normal = 0.5 * Vec3d(cross);
    shape.area = glm::length(shape.normal);
    shape.moment = shape.area / 3 * Vec3d(a + b + c);
    return shape;
}

/// The half-edge from b to a, if the class of the edge from a to b says that there is just that.
uint32_t findTwin(const PolygonMesh& mesh, const Corners& corners, uint32_t h) {
    if (mesh.edge_class[h] != EdgeClass::kManifold) return kNone;
    const uint32_t a = mesh.corner[h], b = mesh.end(h);
    for (const uint32_t g : corners.at(b))
        if (mesh.end(g) == a) return g;
    return kNone;
}

}  // namespace

Corners::Corners(const PolygonMesh& mesh)
    : begin_(mesh.vertexCount() + 1, 0), half_edge_(mesh.halfEdgeCount()) {
    for (const uint32_t v : mesh.corner) ++begin_[v + 1];
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) begin_[v + 1] += begin_[v];
    std::vector<uint32_t> cursor(begin_.begin(), begin_.end() - 1);
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) half_edge_[cursor[mesh.corner[h]]++] = h;
}

PolygonMesh polygonsOf(const Mesh& triangles, std::span<const uint32_t> names,
                       std::span<const uint8_t> interface, std::span<const uint8_t> irregular) {
    PolygonMesh mesh;
    mesh.position = triangles.position;
    mesh.name.assign(names.begin(), names.end());
    mesh.interface_.assign(interface.begin(), interface.end());
    mesh.irregular.assign(irregular.begin(), irregular.end());
    const uint32_t faces = uint32_t(triangles.triangleCount());
    mesh.middle.assign(faces, kNone);
    mesh.shape.reserve(faces);
    mesh.face_begin.reserve(faces + 1);
    mesh.corner.reserve(3 * faces);
    mesh.face.reserve(3 * faces);
    mesh.edge_class.reserve(3 * faces);
    for (uint32_t f = 0; f < faces; ++f) {
        const Triangle& t = triangles.triangle[f];
        mesh.shape.push_back(
            shapeOf(mesh.position[t[0]], mesh.position[t[1]], mesh.position[t[2]]));
        for (int k = 0; k < 3; ++k) {
            mesh.corner.push_back(t[k]);
            mesh.face.push_back(f);
            mesh.edge_class.push_back(triangles.edgeClass(f, k));
        }
        mesh.face_begin.push_back(3 * f + 3);
    }
    const Corners corners(mesh);
    mesh.twin.resize(mesh.halfEdgeCount());
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) mesh.twin[h] = findTwin(mesh, corners, h);
    return mesh;
}

std::vector<uint32_t> outlineStarts(const PolygonMesh& mesh, const Groups& groups) {
    std::vector<uint32_t> start(groups.count, kNone);
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        uint32_t& at = start[groups.of_face[mesh.face[h]]];
        if (at == kNone && separates(mesh, groups, h)) at = h;
    }
    return start;
}

namespace {

/// What mergeFaces() makes, and how it names it.
class Merger {
public:
    Merger(const PolygonMesh& mesh, const Groups& groups, std::span<const uint8_t> keep)
        : mesh_(mesh),
          groups_(groups),
          keep_(keep),
          new_vertex_(mesh.vertexCount(), kNone),
          new_half_edge_(mesh.halfEdgeCount(), kNone) {}

    PolygonMesh run() {
        sumShapes();
        const std::vector<uint32_t> start = outlineStarts(mesh_, groups_);
        for (uint32_t g = 0; g < groups_.count; ++g) traceOutline(start[g]);
        for (uint32_t h = 0; h < out_.halfEdgeCount(); ++h) {
            const uint32_t twin = mesh_.twin[last_[h]];
            out_.twin.push_back(twin == kNone ? kNone : new_half_edge_[twin]);
        }
        findMiddles();
        return std::move(out_);
    }

private:
    void sumShapes() {
        out_.shape.resize(groups_.count);
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f)
            out_.shape[groups_.of_face[f]].add(mesh_.shape[f]);
    }

    uint32_t vertex(uint32_t v) {
        if (new_vertex_[v] == kNone) {
            new_vertex_[v] = out_.vertexCount();
            out_.position.push_back(mesh_.position[v]);
            out_.name.push_back(mesh_.name[v]);
            out_.interface_.push_back(mesh_.interface_[v]);
            out_.irregular.push_back(mesh_.irregular[v]);
        }
        return new_vertex_[v];
    }

    void traceOutline(uint32_t start) {
        CHECK_NE(start, kNone);
        while (!keep_[mesh_.corner[start]]) start = nextOnOutline(mesh_, groups_, start);
        const uint32_t face = uint32_t(out_.face_begin.size() - 1);
        uint32_t h = start;
        do {
            if (keep_[mesh_.corner[h]]) {
                new_half_edge_[h] = out_.halfEdgeCount();
                out_.corner.push_back(vertex(mesh_.corner[h]));
                out_.face.push_back(face);
                out_.edge_class.push_back(mesh_.edge_class[h]);
                last_.push_back(h);
            } else {
                last_.back() = h;
            }
            h = nextOnOutline(mesh_, groups_, h);
        } while (h != start);
        CHECK_LE(out_.face_begin.back() + 3, out_.halfEdgeCount());
        out_.face_begin.push_back(out_.halfEdgeCount());
    }

    /// The candidate that is nearest to the group's centroid, the first of equals.
    void offer(uint32_t group, const Vec3i& position, uint32_t name) {
        const Vec3d d = Vec3d(position) - out_.shape[group].centroid();
        const double distance = glm::dot(d, d);
        uint32_t& at = out_.middle[group];
        if (at == kNone) {
            at = uint32_t(out_.inner_name.size());
            out_.inner_position.push_back(position);
            out_.inner_name.push_back(name);
            distance_.push_back(distance);
        } else if (distance < distance_[at]) {
            out_.inner_position[at] = position;
            out_.inner_name[at] = name;
            distance_[at] = distance;
        }
    }

    void findMiddles() {
        out_.middle.assign(groups_.count, kNone);
        for (uint32_t f = 0; f < mesh_.faceCount(); ++f)
            if (const uint32_t m = mesh_.middle[f]; m != kNone)
                offer(groups_.of_face[f], mesh_.inner_position[m], mesh_.inner_name[m]);
        // Vertices that lie within a group: nothing that begins or ends there separates.
        std::vector<uint32_t> group_at(mesh_.vertexCount(), kNone);
        std::vector<uint8_t> on_outline(mesh_.interface_);
        for (uint32_t h = 0; h < mesh_.halfEdgeCount(); ++h) {
            group_at[mesh_.corner[h]] = groups_.of_face[mesh_.face[h]];
            if (separates(mesh_, groups_, h))
                on_outline[mesh_.corner[h]] = on_outline[mesh_.end(h)] = 1;
        }
        for (uint32_t v = 0; v < mesh_.vertexCount(); ++v)
            if (group_at[v] != kNone && !on_outline[v] && !mesh_.irregular[v])
                offer(group_at[v], mesh_.position[v], mesh_.name[v]);
    }

    const PolygonMesh& mesh_;
    const Groups& groups_;
    std::span<const uint8_t> keep_;
    std::vector<uint32_t> new_vertex_, new_half_edge_;  // of old ones
    std::vector<uint32_t> last_;    // per new half-edge: the last old one that it stands for
    std::vector<double> distance_;  // per inner vertex: squared, to the centroid
    PolygonMesh out_;
};

}  // namespace

PolygonMesh mergeFaces(const PolygonMesh& mesh, const Groups& groups,
                       std::span<const uint8_t> keep) {
    return Merger(mesh, groups, keep).run();
}

std::string faultOf(const PolygonMesh& mesh) {
    std::map<std::pair<uint32_t, uint32_t>, int> uses;
    for (uint32_t f = 0; f < mesh.faceCount(); ++f) {
        std::set<uint32_t> seen;
        for (uint32_t h = mesh.face_begin[f]; h < mesh.face_begin[f + 1]; ++h)
            if (!seen.insert(mesh.corner[h]).second)
                return fmt::format("face {} has vertex {} twice", f, mesh.corner[h]);
        if (mesh.corners(f) < 3) return fmt::format("face {} has {} corners", f, mesh.corners(f));
    }
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        const uint32_t a = mesh.corner[h], b = mesh.end(h), t = mesh.twin[h];
        ++uses[{std::min(a, b), std::max(a, b)}];
        if (t == kNone) continue;
        if (mesh.twin[t] != h || mesh.corner[t] != b || mesh.end(t) != a)
            return fmt::format("half-edge {} does not fit its twin", h);
        if (mesh.face[t] == mesh.face[h]) return fmt::format("face {} meets itself", mesh.face[h]);
    }
    for (uint32_t h = 0; h < mesh.halfEdgeCount(); ++h) {
        const uint32_t a = mesh.corner[h], b = mesh.end(h);
        const int count = uses[{std::min(a, b), std::max(a, b)}];
        const EdgeClass c = mesh.edge_class[h];
        const int most = c == EdgeClass::kBorder ? 1 : c == EdgeClass::kManifold ? 2 : 3;
        const bool at_interface = mesh.interface_[a] && mesh.interface_[b];
        if ((c != EdgeClass::kMany && count > most) || (count < most && !at_interface))
            return fmt::format("an edge of class {} is used {} times", int(c), count);
    }
    return {};
}

}  // namespace pietra::cluster
