#include "simplify/fallback.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/disjoint_sets.h"
#include "geometry/bounds.h"

namespace pietra {
namespace {

struct Box3f {
    Vec3f low{3e38f}, high{-3e38f};
    void add(const Vec3f& p) {
        low = glm::min(low, p);
        high = glm::max(high, p);
    }
    float diagonal() const { return glm::length(high - low); }
};

uint64_t edgeKey(uint32_t a, uint32_t b) {
    return a < b ? uint64_t(a) << 32 | b : uint64_t(b) << 32 | a;
}

uint32_t usesOf(EdgeClass c) {
    return c == EdgeClass::kManifold ? 2 : c == EdgeClass::kBorder ? 1 : 3;
}

EdgeClass classOf(size_t uses) {
    return uses == 1   ? EdgeClass::kBorder
           : uses == 2 ? EdgeClass::kManifold
           : uses == 3 ? EdgeClass::kTriple
                       : EdgeClass::kMany;
}

using Vec3l = glm::i64vec3;

bool hasArea(const WorkingMesh& mesh, const Face& face) {
    const Vec3l a(mesh.point[face.v[0]].vec());
    const Vec3l p = Vec3l(mesh.point[face.v[1]].vec()) - a;
    const Vec3l q = Vec3l(mesh.point[face.v[2]].vec()) - a;
    return p.y * q.z != p.z * q.y || p.z * q.x != p.x * q.z || p.x * q.y != p.y * q.x;
}

}  // namespace

void Fallback::allowForLocks(WorkingMesh& mesh) {
    for (const Face& face : mesh.face) {
        if (face.dead()) continue;
        bool touches = false;
        for (const uint32_t v : face.v) touches |= mesh.point[v].outer();
        mesh.cell_quota[face.cell()] += touches;
    }
    mesh.cells_above = 0;
    for (uint32_t c = 0; c < mesh.cell_count.size(); ++c) mesh.cells_above += mesh.cellAbove(c);
}

void Fallback::relaxQuotas(WorkingMesh& mesh, float factor) {
    mesh.cells_above = 0;
    for (uint32_t c = 0; c < mesh.cell_count.size(); ++c) {
        mesh.cell_quota[c] = uint32_t(factor * float(mesh.cell_quota[c]));
        mesh.cells_above += mesh.cellAbove(c);
    }
}

// Triangles hang together over edges, not over points: what only touches the rest can go without
// opening anything. In the order of their first triangle.
std::vector<Fallback::Component> Fallback::findComponents(const WorkingMesh& mesh) {
    pinBorderTriangles(mesh);
    DisjointSets sets(mesh.face.size());
    for (size_t i = 1; i < edges_.size(); ++i)
        if (edges_[i].key == edges_[i - 1].key)
            sets.unite(edges_[i].corner >> 2, edges_[i - 1].corner >> 2);
    std::vector<uint32_t> index(mesh.face.size(), 0xffffffffu);
    std::vector<Component> components;
    std::vector<Box3f> boxes;
    for (uint32_t f = 0; f < mesh.face.size(); ++f) {
        const Face& face = mesh.face[f];
        if (face.dead()) continue;
        uint32_t& i = index[sets.root(f)];
        if (i == 0xffffffffu) {
            i = uint32_t(components.size());
            components.emplace_back();
            boxes.emplace_back();
        }
        components[i].faces.push_back(f);
        components[i].outer |= pinned_face_[f] != 0;
        for (const uint32_t v : face.v) boxes[i].add(mesh.point[v].vec());
    }
    for (size_t i = 0; i < components.size(); ++i) components[i].diagonal = boxes[i].diagonal();
    return components;
}

uint32_t Fallback::dropComponents(WorkingMesh& mesh, float diameter) {
    std::vector<Component> components = findComponents(mesh);
    std::stable_sort(
        components.begin(), components.end(),
        [](const Component& a, const Component& b) { return a.diagonal < b.diagonal; });
    uint32_t dropped = 0;
    components.pop_back();
    for (const Component& c : components) {
        if (mesh.cells_above == 0 || c.diagonal >= diameter) break;
        const bool wanted = std::any_of(c.faces.begin(), c.faces.end(), [&](uint32_t f) {
            return mesh.cellAbove(mesh.face[f].cell());
        });
        if (c.outer || !wanted) continue;
        for (const uint32_t f : c.faces) mesh.killFace(f);
        dropped += uint32_t(c.faces.size());
    }
    return dropped;
}

void Fallback::collectEdges(const WorkingMesh& mesh) {
    edges_.clear();
    for (uint32_t f = 0; f < mesh.face.size(); ++f) {
        const Face& face = mesh.face[f];
        if (face.dead()) continue;
        for (uint32_t k = 0; k < 3; ++k)
            edges_.push_back({edgeKey(face.v[k], face.v[kNextCorner[k]]), 4 * f + k});
    }
    std::sort(edges_.begin(), edges_.end());
}

/// Triangles on edges that are used elsewhere too must survive as they are.
void Fallback::pinBorderTriangles(const WorkingMesh& mesh) {
    pinned_face_.assign(mesh.face.size(), 0);
    pinned_vertex_.assign(mesh.point.size(), 0);
    shared_edges_.clear();
    collectEdges(mesh);
    for (size_t i = 0, end; i < edges_.size(); i = end) {
        const EdgeClass c = mesh.face[edges_[i].corner >> 2].edgeClass(edges_[i].corner & 3);
        bool complete = true;
        for (end = i; end < edges_.size() && edges_[end].key == edges_[i].key; ++end)
            complete &= mesh.face[edges_[end].corner >> 2].edgeClass(edges_[end].corner & 3) == c;
        complete = complete && c != EdgeClass::kMany && end - i == usesOf(c);
        // Ends of border and non-manifold edges stay where they are, and with them these edges.
        if (c != EdgeClass::kManifold)
            for (const uint32_t k : {edges_[i].corner & 3, kNextCorner[edges_[i].corner & 3]})
                pinned_vertex_[mesh.face[edges_[i].corner >> 2].v[k]] = 1;
        if (complete) continue;
        shared_edges_.push_back(edges_[i].key);
        for (size_t j = i; j < end; ++j) {
            const uint32_t f = edges_[j].corner >> 2;
            pinned_face_[f] = 1;
            for (const uint32_t v : mesh.face[f].v) pinned_vertex_[v] = 1;
        }
    }
}

uint32_t Fallback::clusterVertices(WorkingMesh& mesh, float& spacing) {
    pinBorderTriangles(mesh);
    Box3f box;
    for (const Point& p : mesh.point)
        if (!p.dead()) box.add(p.vec());
    uint32_t merged = 0;
    const float extent = 2 * box.diagonal();
    for (float next = std::max(spacing, 2.0f); mesh.cells_above > 0 && next < 2 * extent;
         next *= 1.4f) {
        if (!mergeBoxes(mesh, next, merged)) break;
        spacing = next;
    }
    classifyEdges(mesh);
    return merged;
}

/// One pass. False, with nothing changed, if no triangle would remain.
bool Fallback::mergeBoxes(WorkingMesh& mesh, float spacing, uint32_t& merged) {
    active_.assign(mesh.point.size(), 0);
    for (const Face& face : mesh.face)
        if (!face.dead() && mesh.cellAbove(face.cell()))
            for (const uint32_t v : face.v) active_[v] = !mesh.point[v].outer();
    members_.clear();
    target_.resize(mesh.point.size());
    for (uint32_t v = 0; v < mesh.point.size(); ++v) {
        target_[v] = v;
        if (!active_[v]) continue;
        const Point& p = mesh.point[v];
        // Coordinates are within 2^20 of the centre, the spacing is at least 2: 21 bits an axis do.
        const auto box = [&](float x) { return uint64_t(std::floor(x / spacing) + 1048576.0f); };
        members_.push_back({box(p.x) | box(p.y) << 21 | box(p.z) << 42, v});
    }
    std::sort(members_.begin(), members_.end());
    for (size_t i = 0, end; i < members_.size(); i = end) {
        for (end = i; end < members_.size() && members_[end].box == members_[i].box;) ++end;
        mergeMembers(mesh, &members_[i], &members_[0] + end);
    }
    const bool some_left = std::any_of(mesh.face.begin(), mesh.face.end(), [&](const Face& face) {
        Face moved = face;
        for (uint32_t& v : moved.v) v = target_[v];
        return !face.dead() && hasArea(mesh, moved);
    });
    if (!some_left) return false;
    merged += remapFaces(mesh);
    dropDoubles(mesh);
    return true;
}

/// All but pinned members go to the member nearest to their mean, a pinned one where there is one.
void Fallback::mergeMembers(const WorkingMesh& mesh, const Member* begin, const Member* end) {
    Vec3f sum(0);
    bool any_pinned = false;
    for (const Member* m = begin; m != end; ++m) {
        sum += mesh.point[m->vertex].vec();
        any_pinned |= pinned_vertex_[m->vertex] != 0;
    }
    const Vec3f mean = sum / float(end - begin);
    uint32_t best = begin->vertex;
    float best_sq = 3e38f;
    for (const Member* m = begin; m != end; ++m) {
        if (any_pinned && !pinned_vertex_[m->vertex]) continue;
        const Vec3f d = mesh.point[m->vertex].vec() - mean;
        if (glm::dot(d, d) >= best_sq) continue;
        best_sq = glm::dot(d, d);
        best = m->vertex;
    }
    for (const Member* m = begin; m != end; ++m)
        if (!pinned_vertex_[m->vertex]) target_[m->vertex] = best;
}

uint32_t Fallback::remapFaces(WorkingMesh& mesh) {
    uint32_t merged = 0;
    for (const Member& m : members_) {
        if (target_[m.vertex] == m.vertex) continue;
        mesh.parent[m.vertex] = target_[m.vertex];
        mesh.point[m.vertex].flags |= kDeadFlag;
        ++merged;
    }
    for (uint32_t f = 0; f < mesh.face.size(); ++f) {
        Face& face = mesh.face[f];
        if (face.dead()) continue;
        for (uint32_t& v : face.v) v = target_[v];
        const auto& v = face.v;
        if (v[0] == v[1] || v[1] == v[2] || v[2] == v[0]) mesh.killFace(f);
    }
    return merged;
}

/// Triangles with the same corners go in pairs: an edge that was used an even number of times is so
/// still, and no hole appears. A pinned one stays, whatever lies on it.
void Fallback::dropDoubles(WorkingMesh& mesh) {
    struct Entry {
        std::array<uint32_t, 3> v;
        uint32_t face;
    };
    std::vector<Entry> entries;
    for (uint32_t f = 0; f < mesh.face.size(); ++f) {
        const Face& face = mesh.face[f];
        if (face.dead()) continue;
        Entry e{{face.v[0], face.v[1], face.v[2]}, f};
        std::sort(e.v.begin(), e.v.end());
        entries.push_back(e);
    }
    std::sort(entries.begin(), entries.end(), [&](const Entry& a, const Entry& b) {
        if (a.v != b.v) return a.v < b.v;
        if (pinned_face_[a.face] != pinned_face_[b.face]) return pinned_face_[a.face] != 0;
        return a.face < b.face;
    });
    for (size_t i = 1; i < entries.size(); ++i) {
        if (entries[i].v != entries[i - 1].v || pinned_face_[entries[i - 1].face]) continue;
        mesh.killFace(entries[i - 1].face);
        mesh.killFace(entries[i].face);
        ++i;
    }
}

/// What is complete in here is classified by its uses; edges used elsewhere too keep their class.
void Fallback::classifyEdges(WorkingMesh& mesh) {
    collectEdges(mesh);
    for (size_t i = 0, end; i < edges_.size(); i = end) {
        for (end = i; end < edges_.size() && edges_[end].key == edges_[i].key;) ++end;
        const EdgeClass c = classOf(end - i);
        if (std::binary_search(shared_edges_.begin(), shared_edges_.end(), edges_[i].key)) continue;
        for (size_t j = i; j < end; ++j)
            mesh.face[edges_[j].corner >> 2].setEdgeClass(edges_[j].corner & 3, c);
    }
}

}  // namespace pietra
