#include "simplify/collapse.h"

#include <algorithm>
#include <bit>
#include <cmath>

namespace pietra {

/// Reads the fan of u into the ring and the triangles on the edge into the wings; marks u's link
/// and the wings' vertices. Drops dead corners from the fan. False if the edge has none or too many
/// triangles, or two on the same three vertices.
bool Collapser::readFirstRing(uint32_t u, uint32_t v) {
    Fan& fan = mesh_.fan[u];
    uint32_t* corners = mesh_.corner.data() + fan.begin;
    const uint32_t in_link = mesh_.epoch += 2, is_wing = in_link + 1;
    uint32_t alive = 0, size = 0, wings = 0;
    for (uint32_t i = 0; i < fan.count; ++i) {
        const uint32_t corner = corners[i];
        const Face& face = mesh_.face[corner >> 2];
        if (face.dead()) continue;
        corners[alive++] = corner;
        const uint32_t k = corner & 3;
        const uint32_t n = face.v[kNextCorner[k]], p = face.v[kPreviousCorner[k]];
        if (n == v || p == v) {
            wing_[std::min(wings++, kMaxWings)] = {
                corner >> 2, n == v ? p : n, face.edgeClass(n == v ? kPreviousCorner[k] : k),
                face.edgeClass(kNextCorner[k]), EdgeClass::kManifold};
            continue;
        }
        ring_.corner[size] = corner;
        ring_.apex[size] = u;
        ring_.next[size] = n;
        ring_.previous[size] = p;
        ++size;
        mesh_.mark[n] = mesh_.mark[p] = in_link;
    }
    fan.count = alive;
    ring_.size_u = ring_.size = size;
    if (wings == 0 || wings > kMaxWings) return false;
    wing_count_ = wings;
    for (uint32_t i = 0; i < wings; ++i) {
        uint32_t& mark = mesh_.mark[wing_[i].vertex];
        if (mark == is_wing) return false;
        mark = is_wing;
    }
    return true;
}

/// Some triangle that dies must be of a cell above its quota. And of two edges that become one, one
/// must be ordinary with both its triangles in here: then the other's uses are the new edge's.
bool Collapser::wingsAllow(const Point& u, const Point& v) {
    bool wanted = free_;
    for (uint32_t i = 0; i < wing_count_; ++i) {
        Wing& w = wing_[i];
        wanted |= mesh_.cellAbove(mesh_.face[w.face].cell());
        if (w.to_u == EdgeClass::kManifold && w.to_v == EdgeClass::kManifold) continue;
        const bool outer = mesh_.point[w.vertex].outer();
        if (w.to_u == EdgeClass::kManifold && !(outer && u.outer()))
            w.merged = w.to_v;
        else if (w.to_v == EdgeClass::kManifold && !(outer && v.outer()))
            w.merged = w.to_u;
        else
            return false;
    }
    return wanted;
}

/// Appends the fan of v to the ring, and checks the link condition: both ends share no neighbours
/// but those across the edge's triangles, and no edge of their links (or two triangles would become
/// one: a closed tetrahedron has such).
bool Collapser::readSecondRing(uint32_t v, uint32_t u) {
    Fan& fan = mesh_.fan[v];
    uint32_t* corners = mesh_.corner.data() + fan.begin;
    const uint32_t in_link = mesh_.epoch, is_wing = in_link + 1;
    uint32_t alive = 0, size = ring_.size;
    bool allowed = true;
    for (uint32_t i = 0; i < fan.count; ++i) {
        const uint32_t corner = corners[i];
        const Face& face = mesh_.face[corner >> 2];
        if (face.dead()) continue;
        corners[alive++] = corner;
        const uint32_t n = face.v[kNextCorner[corner & 3]];
        const uint32_t p = face.v[kPreviousCorner[corner & 3]];
        if (n == u || p == u) continue;
        ring_.corner[size] = corner;
        ring_.apex[size] = v;
        ring_.next[size] = n;
        ring_.previous[size] = p;
        ++size;
        const uint32_t mark_n = mesh_.mark[n], mark_p = mesh_.mark[p];
        allowed &= mark_n != in_link && mark_p != in_link;
        if (mark_n == is_wing && mark_p == is_wing) [[unlikely]]
            allowed = allowed && !facesMeet(n, p);
    }
    fan.count = alive;
    ring_.size = size;
    return allowed && size != 0;
}

/// True if u has a triangle on the edge (a, b).
bool Collapser::facesMeet(uint32_t a, uint32_t b) const {
    for (uint32_t i = 0; i < ring_.size_u; ++i) {
        const uint32_t n = ring_.next[i], p = ring_.previous[i];
        if ((n == a && p == b) || (n == b && p == a)) return true;
    }
    return false;
}

/// True if the removed vertex, merged into an outer one, would make a new edge to an outer vertex:
/// the diamond across the border could make the same, and it would have four triangles.
bool Collapser::makesOuterEdge() const {
    const auto isNew = [&](uint32_t w) {
        for (uint32_t i = 0; i < wing_count_; ++i)
            if (wing_[i].vertex == w) return false;
        return true;
    };
    for (uint32_t i = 0; i < ring_.size_u; ++i) {
        const uint32_t n = ring_.next[i], p = ring_.previous[i];
        if (mesh_.point[n].outer() && isNew(n)) return true;
        if (mesh_.point[p].outer() && isNew(p)) return true;
    }
    return false;
}

namespace {

/// Twice the area, squared, over the longest edge to the fourth: 3/4 for an equilateral triangle.
float shapeOf(float normal_sq, float a_sq, float b_sq, float c_sq) {
    const float longest = std::max(a_sq, std::max(b_sq, c_sq));
    return normal_sq / (longest * longest);
}

/// Exact: the triangle of these two sides is not degenerate.
bool hasArea(const Vec3f& a, const Vec3f& b) {
    const int64_t ax = int64_t(a.x), ay = int64_t(a.y), az = int64_t(a.z);
    const int64_t bx = int64_t(b.x), by = int64_t(b.y), bz = int64_t(b.z);
    return ay * bz != az * by || az * bx != ax * bz || ax * by != ay * bx;
}

}  // namespace

/// None of the ring's first `count` triangles may turn by more than acos(0.2), become a sliver or
/// lose its area when its apex goes to `to`.
bool Collapser::keepsShapes(uint32_t count, const Vec3f& to) {
    for (uint32_t pad = ring_.size; pad % kFoldBatch != 0; ++pad) {
        ring_.apex[pad] = ring_.apex[0];
        ring_.next[pad] = ring_.next[0];
        ring_.previous[pad] = ring_.previous[0];
    }
    for (uint32_t i = 0; i < count; i += kFoldBatch) {
        uint32_t suspects = kernels_.foldingTriangles(mesh_.point.data(), &ring_.apex[i],
                                                      &ring_.next[i], &ring_.previous[i], to);
        for (; suspects != 0; suspects &= suspects - 1) {
            const uint32_t j = i + uint32_t(std::countr_zero(suspects));
            if (j < count && !keepsShape(j, to)) return false;
        }
    }
    return true;
}

/// As the kernel says, but slivers may become better ones, and degenerate triangles turn anyhow.
bool Collapser::keepsShape(uint32_t i, const Vec3f& to) const {
    const Vec3f from = mesh_.point[ring_.apex[i]].vec();
    const Vec3f n = mesh_.point[ring_.next[i]].vec(), p = mesh_.point[ring_.previous[i]].vec();
    const Vec3f old_n = n - from, old_p = p - from, new_n = n - to, new_p = p - to;
    const Vec3f old_normal = glm::cross(old_n, old_p), new_normal = glm::cross(new_n, new_p);
    const float old_sq = glm::dot(old_normal, old_normal);
    const float new_sq = glm::dot(new_normal, new_normal);
    const float opposite = glm::dot(n - p, n - p);
    const float new_shape =
        shapeOf(new_sq, glm::dot(new_n, new_n), glm::dot(new_p, new_p), opposite);
    if (!(new_shape > min_shape_)) {
        const float old_shape =
            shapeOf(old_sq, glm::dot(old_n, old_n), glm::dot(old_p, old_p), opposite);
        if (!(new_shape >= old_shape) || !hasArea(new_n, new_p)) return false;
    }
    if (!(old_sq > 0)) return true;
    const float turn = glm::dot(old_normal, new_normal);
    return turn > 0 && turn * (turn / old_sq) > kMinCosineSq * new_sq;
}

bool Collapser::allows(uint32_t u, uint32_t v, const Vec3f& to) {
    if (mesh_.fan[u].count + mesh_.fan[v].count > kMaxRing) return false;
    const Point &pu = mesh_.point[u], &pv = mesh_.point[v];
    if (!readFirstRing(u, v) || !wingsAllow(pu, pv) || !readSecondRing(v, u)) return false;
    if (pv.outer() && makesOuterEdge()) return false;
    if (positions_.occupied(mesh_, to, u, v)) return false;
    const bool v_moves = pv.rank() == pu.rank();
    return keepsShapes(v_moves ? ring_.size : ring_.size_u, to);
}

float Collapser::deviation(uint32_t u, uint32_t v, const Vec3f& to) const {
    float largest = 0;
    for (const uint32_t end : {u, v}) {
        float least = HUGE_VALF;
        for (uint32_t i = 0; i < ring_.size; i += kFoldBatch)
            least = std::min(
                least, kernels_.fanDistanceSq(mesh_.point.data(), &ring_.next[i],
                                              &ring_.previous[i], to, mesh_.point[end].vec()));
        largest = std::max(largest, std::sqrt(least) + mesh_.quadric[end].deviation);
    }
    return largest;
}

void Collapser::apply(uint32_t u, uint32_t v, const Vec3f& to) {
    Point &pu = mesh_.point[u], &pv = mesh_.point[v];
    pv = {to.x, to.y, to.z, pv.flags | (pu.flags & kIrregularFlag)};
    mesh_.killVertex(u);
    mesh_.parent[u] = v;
    ++mesh_.stamp[v];
    for (uint32_t i = 0; i < ring_.size_u; ++i)
        mesh_.face[ring_.corner[i] >> 2].v[ring_.corner[i] & 3] = v;
    for (uint32_t i = 0; i < wing_count_; ++i) {
        mesh_.killFace(wing_[i].face);
        if (wing_[i].merged != EdgeClass::kManifold)
            setClassOfEdgesTo(wing_[i].vertex, wing_[i].merged);
    }
    writeFan(v);
}

void Collapser::setClassOfEdgesTo(uint32_t w, EdgeClass c) {
    for (uint32_t i = 0; i < ring_.size; ++i) {
        Face& face = mesh_.face[ring_.corner[i] >> 2];
        const uint32_t k = ring_.corner[i] & 3;
        if (ring_.next[i] == w) face.setEdgeClass(k, c);
        if (ring_.previous[i] == w) face.setEdgeClass(kPreviousCorner[k], c);
    }
}

/// In place where the ring fits into the old fan, else at the arena's end.
void Collapser::writeFan(uint32_t v) {
    Fan& fan = mesh_.fan[v];
    if (ring_.size > fan.count) {
        if (mesh_.corner_end + ring_.size > mesh_.corner.size())
            mesh_.corner.resize(2 * mesh_.corner.size() + ring_.size);
        fan.begin = mesh_.corner_end;
        mesh_.corner_end += ring_.size;
    }
    fan.count = ring_.size;
    std::copy_n(ring_.corner.data(), ring_.size, mesh_.corner.data() + fan.begin);
}

}  // namespace pietra
