#include "simplify/fallback.h"

#include <algorithm>
#include <array>
#include <cmath>

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

float areaOf(const WorkingMesh& mesh, const Face& face) {
    const Vec3f a = mesh.point[face.v[0]].vec();
    const Vec3f n = glm::cross(mesh.point[face.v[1]].vec() - a, mesh.point[face.v[2]].vec() - a);
    return std::sqrt(glm::dot(n, n));
}

/// Union-find over the vertices, apart from WorkingMesh::parent.
class Components {
public:
    explicit Components(const WorkingMesh& mesh) : parent_(mesh.point.size()) {
        for (uint32_t v = 0; v < parent_.size(); ++v) parent_[v] = v;
        for (const Face& face : mesh.face) {
            if (face.dead()) continue;
            unite(face.v[0], face.v[1]);
            unite(face.v[0], face.v[2]);
        }
    }
    uint32_t root(uint32_t v) {
        while (parent_[v] != v) v = parent_[v] = parent_[parent_[v]];
        return v;
    }

private:
    void unite(uint32_t a, uint32_t b) {
        a = root(a);
        b = root(b);
        if (a != b) parent_[std::max(a, b)] = std::min(a, b);
    }
    std::vector<uint32_t> parent_;
};

struct Component {
    Box3f box;
    float diagonal = 0;
    bool outer = false;
    std::vector<uint32_t> faces;
};

/// In the order of their first triangle.
std::vector<Component> findComponents(const WorkingMesh& mesh) {
    Components sets(mesh);
    std::vector<uint32_t> index(mesh.point.size(), 0xffffffffu);
    std::vector<Component> components;
    for (uint32_t f = 0; f < mesh.face.size(); ++f) {
        const Face& face = mesh.face[f];
        if (face.dead()) continue;
        uint32_t& i = index[sets.root(face.v[0])];
        if (i == 0xffffffffu) {
            i = uint32_t(components.size());
            components.emplace_back();
        }
        Component& c = components[i];
        c.faces.push_back(f);
        for (const uint32_t v : face.v) {
            c.box.add(mesh.point[v].vec());
            c.outer |= mesh.point[v].outer();
        }
    }
    for (Component& c : components) c.diagonal = c.box.diagonal();
    return components;
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
        for (const uint32_t f : c.faces) {
            mesh.killFace(f);
            for (const uint32_t v : mesh.face[f].v) mesh.point[v].flags |= kDeadFlag;
        }
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
    thinEdges(mesh);
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
        if (!pinned_face_[f] && !hasArea(mesh, face)) mesh.killFace(f);
    }
    return merged;
}

/// Of triangles with the same corners the first is kept, a pinned one before others.
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
    for (size_t i = 1; i < entries.size(); ++i)
        if (entries[i].v == entries[i - 1].v) mesh.killFace(entries[i].face);
}

/// Leaves at most three triangles at each edge, the largest ones.
void Fallback::thinEdges(WorkingMesh& mesh) {
    collectEdges(mesh);
    struct Candidate {
        float area;
        uint32_t face;
    };
    std::vector<Candidate> candidates;
    std::vector<uint8_t> crowded(mesh.face.size(), 0);
    for (size_t i = 0, end; i < edges_.size(); i = end) {
        for (end = i; end < edges_.size() && edges_[end].key == edges_[i].key;) ++end;
        for (size_t j = i; end - i > 3 && j < end; ++j) crowded[edges_[j].corner >> 2] = 1;
    }
    for (uint32_t f = 0; f < mesh.face.size(); ++f)
        if (crowded[f] && !pinned_face_[f]) candidates.push_back({areaOf(mesh, mesh.face[f]), f});
    std::sort(candidates.begin(), candidates.end(), [](const Candidate& a, const Candidate& b) {
        return a.area != b.area ? a.area < b.area : a.face > b.face;
    });
    for (const Candidate& c : candidates) {
        const Face& face = mesh.face[c.face];
        bool too_many = false;
        for (uint32_t k = 0; k < 3; ++k) {
            const EdgeUse first{edgeKey(face.v[k], face.v[kNextCorner[k]]), 0};
            uint32_t alive = 0;
            for (auto e = std::lower_bound(edges_.begin(), edges_.end(), first);
                 e != edges_.end() && e->key == first.key; ++e)
                alive += !mesh.face[e->corner >> 2].dead();
            too_many |= alive > 3;
        }
        if (too_many) mesh.killFace(c.face);
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
