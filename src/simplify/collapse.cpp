#include "simplify/collapse.h"

#include <algorithm>
#include <utility>

namespace pietra {

Placement placeEdge(const WorkingMesh& mesh, uint32_t u, uint32_t v, const SnapGrid& grid) {
    const Point& pu = mesh.point[u];
    const Point& pv = mesh.point[v];
    const Vec3f edge = pv.vec() - pu.vec();
    Quadric q = mesh.quadric[v].movedBy(-edge);
    q.add(mesh.quadric[u]);
    Vec3f z;
    if (pu.rank() > pv.rank()) {
        z = {0, 0, 0};
    } else if (pv.rank() > pu.rank()) {
        z = edge;
    } else {
        z = q.minimum();
        const Vec3f middle = edge * 0.5f;
        const Vec3f off = z - middle;
        if (!(glm::dot(off, off) <= glm::dot(edge, edge))) z = middle;
        z = grid.snap(pu.vec() + z) - pu.vec();
    }
    return {pu.vec() + z, std::max(q.valueAt(z), 0.0f)};
}

void Collapser::findWings(uint32_t u, uint32_t v) {
    wing_count_ = 0;
    const Fan& fan = mesh_.fan[u];
    for (uint32_t i = 0; i < fan.count; ++i) {
        const uint32_t corner = mesh_.corner[fan.begin + i];
        const Face& face = mesh_.face[corner >> 2];
        if (face.dead()) continue;
        const uint32_t k = corner & 3, n = kNextCorner[k], p = kPreviousCorner[k];
        if (face.v[n] != v && face.v[p] != v) continue;
        if (wing_count_ == wing_.size()) {
            wing_count_ = 0;  // four triangles: never collapsible
            return;
        }
        const bool forward = face.v[n] == v;
        wing_[wing_count_++] = {corner >> 2, forward ? face.v[p] : face.v[n],
                                face.edgeClass(forward ? p : k), face.edgeClass(n),
                                EdgeClass::kManifold};
    }
}

bool Collapser::quotaAllows() const {
    for (uint32_t i = 0; i < wing_count_; ++i)
        if (mesh_.cellAbove(mesh_.face[wing_[i].face].cell())) return true;
    return false;
}

/// Of the two edges that become one, one must be an ordinary edge with both its triangles in here:
/// then the other one's uses are the new edge's.
bool Collapser::mergeWingClasses(const Point& u, const Point& v) {
    for (uint32_t i = 0; i < wing_count_; ++i) {
        Wing& w = wing_[i];
        if (w.to_u == EdgeClass::kManifold && w.to_v == EdgeClass::kManifold) continue;
        const bool outer = mesh_.point[w.vertex].outer();
        if (w.to_u == EdgeClass::kManifold && !(outer && u.outer()))
            w.merged = w.to_v;
        else if (w.to_v == EdgeClass::kManifold && !(outer && v.outer()))
            w.merged = w.to_u;
        else
            return false;
    }
    return true;
}

/// Also drops dead corners from the fan.
void Collapser::readRing(uint32_t v, uint32_t other, Ring& ring) {
    Fan& fan = mesh_.fan[v];
    uint32_t* corners = mesh_.corner.data() + fan.begin;
    uint32_t alive = 0, size = 0;
    for (uint32_t i = 0; i < fan.count; ++i) {
        const uint32_t corner = corners[i];
        const Face& face = mesh_.face[corner >> 2];
        if (face.dead()) continue;
        corners[alive++] = corner;
        const uint32_t n = face.v[kNextCorner[corner & 3]];
        const uint32_t p = face.v[kPreviousCorner[corner & 3]];
        ring.corner[size] = corner;
        ring.next[size] = n;
        ring.previous[size] = p;
        size += n != other && p != other;
    }
    fan.count = alive;
    ring.size = size;
}

/// The link condition: both ends share no neighbours but those across the edge's triangles, and no
/// edge of their links (or two triangles would become one: a closed tetrahedron has such).
bool Collapser::linksAllow() {
    const uint32_t in_link = mesh_.epoch + 1, is_wing = mesh_.epoch + 2;
    mesh_.epoch += 2;
    for (uint32_t i = 0; i < wing_count_; ++i) {
        uint32_t& mark = mesh_.fan[wing_[i].vertex].mark;
        if (mark == is_wing) return false;
        mark = is_wing;
    }
    const auto markLink = [&](uint32_t w) {
        uint32_t& mark = mesh_.fan[w].mark;
        mark = mark == is_wing ? is_wing : in_link;
        return mark == is_wing;
    };
    const Ring &of_u = ring_[0], &of_v = ring_[1];
    bool wings_joined = false;
    for (uint32_t i = 0; i < of_u.size; ++i) {
        const bool next_is_wing = markLink(of_u.next[i]);
        wings_joined |= markLink(of_u.previous[i]) && next_is_wing;
    }
    for (uint32_t i = 0; i < of_v.size; ++i) {
        const uint32_t n = mesh_.fan[of_v.next[i]].mark, p = mesh_.fan[of_v.previous[i]].mark;
        if (n == in_link || p == in_link) return false;
        if (wings_joined && n == is_wing && p == is_wing) return false;
    }
    return true;
}

/// True if the removed vertex, merged into an outer one, would make a new edge to an outer vertex:
/// the diamond across the border could make the same, and it would have four triangles.
bool Collapser::makesOuterEdge() const {
    const Ring& ring = ring_[0];
    const auto isNew = [&](uint32_t w) {
        for (uint32_t i = 0; i < wing_count_; ++i)
            if (wing_[i].vertex == w) return false;
        return true;
    };
    for (uint32_t i = 0; i < ring.size; ++i) {
        if (mesh_.point[ring.next[i]].outer() && isNew(ring.next[i])) return true;
        if (mesh_.point[ring.previous[i]].outer() && isNew(ring.previous[i])) return true;
    }
    return false;
}

namespace {

/// Twice the area, squared, over the longest edge to the fourth: 3/4 for an equilateral triangle.
float shapeOf(float normal_sq, float a_sq, float b_sq, float c_sq) {
    const float longest = std::max(a_sq, std::max(b_sq, c_sq));
    return normal_sq / (longest * longest);
}

/// Exact: twice the area is not zero.
bool hasArea(const Vec3f& a, const Vec3f& b) {
    const int64_t ax = int64_t(a.x), ay = int64_t(a.y), az = int64_t(a.z);
    const int64_t bx = int64_t(b.x), by = int64_t(b.y), bz = int64_t(b.z);
    return ay * bz != az * by || az * bx != ax * bz || ax * by != ay * bx;
}

constexpr float kMinCosineSq = 0.2f * 0.2f;
/// Height about 1/60 of the longest edge. Worse triangles may not get worse still.
constexpr float kMinShape = 3e-4f;

}  // namespace

/// No triangle of the ring may turn by more than acos(0.2), become a sliver or lose its area when
/// its apex goes from `from` to `to`.
bool Collapser::keepsShape(const Ring& ring, const Vec3f& from, const Vec3f& to) const {
    for (uint32_t i = 0; i < ring.size; ++i) {
        const Vec3f n = mesh_.point[ring.next[i]].vec(), p = mesh_.point[ring.previous[i]].vec();
        const Vec3f old_n = n - from, old_p = p - from, new_n = n - to, new_p = p - to;
        const Vec3f old_normal = glm::cross(old_n, old_p), new_normal = glm::cross(new_n, new_p);
        const float old_sq = glm::dot(old_normal, old_normal);
        const float new_sq = glm::dot(new_normal, new_normal);
        const float opposite = glm::dot(n - p, n - p);
        const float new_shape =
            shapeOf(new_sq, glm::dot(new_n, new_n), glm::dot(new_p, new_p), opposite);
        if (!(new_shape > kMinShape)) {
            const float old_shape =
                shapeOf(old_sq, glm::dot(old_n, old_n), glm::dot(old_p, old_p), opposite);
            if (!(new_shape >= old_shape) || !hasArea(new_n, new_p)) return false;
        }
        const float dot = glm::dot(old_normal, new_normal);
        if (!(dot > 0 && dot * dot > kMinCosineSq * old_sq * new_sq) && old_sq > 0) return false;
    }
    return true;
}

uint32_t Collapser::tryCollapse(uint32_t u, uint32_t v, const SnapGrid& grid) {
    if (mesh_.point[u].rank() > mesh_.point[v].rank()) std::swap(u, v);
    if (mesh_.fan[u].count + mesh_.fan[v].count > kMaxRing) return kNoVertex;
    findWings(u, v);
    if (wing_count_ == 0 || !quotaAllows()) return kNoVertex;
    const Point &pu = mesh_.point[u], &pv = mesh_.point[v];
    if (!mergeWingClasses(pu, pv)) return kNoVertex;
    readRing(u, v, ring_[0]);
    readRing(v, u, ring_[1]);
    if (ring_[0].size + ring_[1].size == 0) return kNoVertex;
    if (!linksAllow()) return kNoVertex;
    if (pv.outer() && makesOuterEdge()) return kNoVertex;
    placement_ = placeEdge(mesh_, u, v, grid);
    if (positions_.occupied(mesh_, placement_.position, u, v)) return kNoVertex;
    if (!keepsShape(ring_[0], pu.vec(), placement_.position)) return kNoVertex;
    if (pv.rank() <= pu.rank() && !keepsShape(ring_[1], pv.vec(), placement_.position))
        return kNoVertex;
    apply(u, v);
    return v;
}

void Collapser::apply(uint32_t u, uint32_t v) {
    Point &pu = mesh_.point[u], &pv = mesh_.point[v];
    const Vec3f to = placement_.position;
    Quadric q = mesh_.quadric[u].movedBy(to - pu.vec());
    q.add(mesh_.quadric[v].movedBy(to - pv.vec()));
    mesh_.quadric[v] = q;
    pv = {to.x, to.y, to.z, pv.flags | (pu.flags & kIrregularFlag)};
    pu.flags |= kDeadFlag;
    mesh_.parent[u] = v;
    ++mesh_.fan[v].stamp;
    removed_ = u;
    for (uint32_t i = 0; i < wing_count_; ++i) mesh_.killFace(wing_[i].face);
    const Ring& ring = ring_[0];
    for (uint32_t i = 0; i < ring.size; ++i)
        mesh_.face[ring.corner[i] >> 2].v[ring.corner[i] & 3] = v;
    for (uint32_t i = 0; i < wing_count_; ++i) {
        if (wing_[i].merged == EdgeClass::kManifold) continue;
        for (const Ring& r : ring_)
            for (uint32_t j = 0; j < r.size; ++j) {
                Face& face = mesh_.face[r.corner[j] >> 2];
                const uint32_t k = r.corner[j] & 3;
                if (r.next[j] == wing_[i].vertex) face.setEdgeClass(k, wing_[i].merged);
                if (r.previous[j] == wing_[i].vertex)
                    face.setEdgeClass(kPreviousCorner[k], wing_[i].merged);
            }
    }
    writeFan(v);
}

/// In place where both rings fit into the old fan, else at the arena's end.
void Collapser::writeFan(uint32_t v) {
    Fan& fan = mesh_.fan[v];
    const uint32_t size = ring_[0].size + ring_[1].size;
    if (size > fan.count) {
        if (mesh_.corner_end + size > mesh_.corner.size())
            mesh_.corner.resize(2 * mesh_.corner.size() + size);
        fan.begin = mesh_.corner_end;
        mesh_.corner_end += size;
    }
    fan.count = size;
    uint32_t* out = mesh_.corner.data() + fan.begin;
    for (const Ring& r : ring_) out = std::copy_n(r.corner.data(), r.size, out);
}

}  // namespace pietra
