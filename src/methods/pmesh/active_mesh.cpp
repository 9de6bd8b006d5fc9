#include "methods/pmesh/active_mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "base/parallel.h"
#include "geometry/bounds.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kGrain = 256;
constexpr auto kRelaxed = std::memory_order_relaxed;

/// Six bits of x, every third bit of the result.
uint32_t spread(uint32_t x) {
    uint32_t bits = x & 0x3f;
    bits = (bits | bits << 8) & 0x0300f;
    bits = (bits | bits << 4) & 0x030c3;
    return (bits | bits << 2) & 0x09249;
}

/// Where each of `count` elements goes: those from `first` on by their keys, each below `keys`; the
/// others stay.
template <class KeyOf>
std::vector<uint32_t> placesByKey(size_t first, size_t count, size_t keys, KeyOf&& key_of) {
    std::vector<uint32_t> place(count), begin(keys + 1, 0);
    parallelForSlices(count - first, 16 * kGrain, [&](size_t from, size_t to) {
        for (size_t i = first + from; i < first + to; ++i) place[i] = key_of(uint32_t(i));
    });
    for (size_t i = first; i < count; ++i) ++begin[place[i] + 1];
    begin[0] = uint32_t(first);
    std::partial_sum(begin.begin(), begin.end(), begin.begin());
    for (size_t i = first; i < count; ++i) place[i] = begin[place[i]]++;
    std::iota(place.begin(), place.begin() + ptrdiff_t(first), 0u);
    return place;
}

template <class T>
void permute(std::vector<T>& elements, const std::vector<uint32_t>& place) {
    std::vector<T> moved(elements.size());
    parallelForSlices(elements.size(), 16 * kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) moved[place[i]] = elements[i];
    });
    elements.swap(moved);
}

}  // namespace

uint16_t radiusAroundU(const Operation& o) {
    const Vec3d d(o.offset(o.isDummy() ? 0 : 1));
    const int64_t rest = int64_t(decodeRadius(o.radius)) - int64_t(std::sqrt(glm::dot(d, d))) - 1;
    if (rest <= 0) return 0;
    const uint32_t code = encodeRoundedUp<11>(uint64_t(rest));
    return uint16_t(decodeRadius(code) > rest ? code - 1 : code);
}

ActiveMesh::ActiveMesh(const ProgressiveMesh& mesh, const References* references)
    : source_(&mesh), references_(references) {
    HalfEdges edges = findHalfEdges(mesh.base_triangle, mesh.base_vertex.size());
    vertex = mesh.base_vertex;
    pulse.resize(vertex.size());
    record.resize(vertex.size());
    criteria.resize(vertex.size());
    for (uint32_t v = 0; v < vertex.size(); ++v) {
        pulse[v].name = v;
        pulse[v].corner = edges.corner_of[v];
        setLast(v, kNoOperation);
        setNext(v, mesh.base_operation[v]);
    }
    face.resize(mesh.base_triangle.size());
    for (uint32_t f = 0; f < face.size(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            setVertexAt(4 * f + k, mesh.base_triangle[f][k]);
            setTwin(4 * f + k, edges.twin[3 * f + k]);
        }
    for (uint32_t f = 0; f < mesh.base_closed.size(); ++f) face[f].left[3] = mesh.base_closed[f];
    for (const ActiveFace& f : face)
        for (uint32_t k = 0; k < 3; ++k) {
            // An edge is met once in each direction, but at a border.
            const uint32_t v = f.vertex[k], w = f.vertex[k + 1];
            pulse[v].around += pulse[w].weightOn(pulse[v]);
            const bool border = f.left[(k + 1) % 3] == kNoCorner;
            if (border) pulse[w].around += pulse[v].weightOn(pulse[w]);
        }
}

void ActiveMesh::resize(size_t vertices, size_t faces) {
    vertex.resize(vertices);
    pulse.resize(vertices);
    record.resize(vertices);
    criteria.resize(vertices);
    face.resize(faces);
}

void ActiveMesh::setNext(uint32_t v, OperationId next) {
    record[v].next = next;
    record[v].provisional = 0;
    if (next == kNoOperation) {
        pulse[v].next_level = uint16_t(kLeafLevel);
        criteria[v].split_radius = criteria[v].split_error = 0;
        criteria[v].split_normals = 0;
    } else if (source_->isLoaded(next)) {
        pulse[v].next_level = source_->at(next).level;
        updateCriteria(v);
    } else {
        const Reference reference = references_->referenceTo(next);
        const Vec3d d(vertex[v].position() - reference.centre);
        const uint32_t radius =
            decodeRadius(reference.radius) + uint32_t(std::sqrt(glm::dot(d, d))) + 1;
        pulse[v].next_level = reference.level;
        criteria[v].split_radius = uint16_t(encodeRoundedUp<11>(radius));
        criteria[v].split_error = reference.error;
        // The operation that it hangs below encloses it.
        criteria[v].split_normals = source_->at(record[v].last).normals.word();
        record[v].provisional = 1;
    }
}

void ActiveMesh::updateCriteria(uint32_t v) {
    const Operation& o = source_->at(record[v].next);
    criteria[v].split_radius = o.radius;
    criteria[v].split_error = o.error;
    criteria[v].split_normals = o.normals.word();
    record[v].provisional = 0;
}

void ActiveMesh::setLast(uint32_t v, OperationId last) {
    record[v].last = last;
    criteria[v].merge_radius = VertexCriteria::kEverNeeded;
    criteria[v].merge_error = 0;
    criteria[v].merge_normals = 0;
    pulse[v].last_level = 0;
    if (last == kNoOperation) return;
    const Operation& o = source_->at(last);
    pulse[v].last_level = uint16_t(o.level + 1);
    if (!canUndo(v)) return;
    criteria[v].merge_radius = radiusAroundU(o);
    criteria[v].merge_error = o.error;
    criteria[v].merge_normals = o.normals.word();
}

bool ActiveMesh::orient(Star& star) const {
    if (star.count == 0 || star.neighbours() > kMaxNeighbours) return false;
    if (!star.closed) return true;
    uint32_t least_name = ~0u;
    for (uint32_t i = 0; i < star.count; ++i) {
        const uint32_t name = pulse[star.neighbour[i]].name;
        star.first = name < least_name ? i : star.first;
        least_name = std::min(name, least_name);
    }
    return true;
}

bool ActiveMesh::mayBeNext(Star& star, uint32_t v) const {
    const int32_t far = (1 << 22) >> source_->lattice.shift;  // no sum overflows
    const Operation& o = source_->at(record[v].next);
    if (star.count == 0 || (!o.isDummy() && !orient(star))) return false;
    const uint32_t n = star.neighbours(), l = o.rankLeft(), r = o.rankRight();
    for (const int end : {0, 1}) {
        const Vec3i p = glm::abs(vertex[v].position() + o.offset(end));
        if (std::max({p.x, p.y, p.z}) > far) return false;
    }
    if (o.level != pulse[v].next_level) return false;
    for (const uint32_t w : star.ring())
        if (pulse[w].next_level <= o.level) return false;
    if (o.isDummy()) return o.child[1] == record[v].last;
    if ((l != kNoRank && l >= n) || (r != kNoRank && r >= n)) return false;
    return star.closed ? l != kNoRank && r != kNoRank : l == kNoRank || r == kNoRank || r < l;
}

/// Its triangles change.
void ActiveMesh::touch(const Star& star) {
    if (chunk_touched.empty()) return;
    for (uint32_t i = 0; i < star.count; ++i) {
        const std::atomic_ref touched(chunk_touched[face[star.corner[i] >> 2].chunk()]);
        if (!touched.load(kRelaxed)) touched.store(1, kRelaxed);
    }
}

void ActiveMesh::link(uint32_t half_edge, uint32_t other) {
    if (half_edge != kNoCorner) setTwin(half_edge, other);
    if (other != kNoCorner) setTwin(other, half_edge);
}

/// The first corner of the fan that has this one, or this one where the fan is closed.
uint32_t ActiveMesh::firstCorner(uint32_t corner) const {
    for (uint32_t c = corner;;) {
        const uint32_t t = twinOf(c);
        if (t == kNoCorner) return c;
        c = nextCorner(t);
        if (c == corner) return c;
    }
}

/// v alone has changed its levels.
void ActiveMesh::changeAround(uint32_t v, const Star& star, const VertexPulse& before) {
    const VertexPulse& after = pulse[v];
    uint32_t around = 0;
    for (const uint32_t w : star.ring()) {
        addAround(w, after.weightOn(pulse[w]) - before.weightOn(pulse[w]));
        around += pulse[w].weightOn(after);
    }
    pulse[v].around = around;
}

void ActiveMesh::move(uint32_t v, const Star& star) {
    const VertexPulse before = pulse[v];
    const OperationId id = record[v].next;
    const Operation& o = source_->at(id);
    touch(star);
    vertex[v].moveBy(o.offset(0));
    setLast(v, id);
    setNext(v, o.child[0]);
    changeAround(v, star, before);
}

void ActiveMesh::moveBack(uint32_t v, const Star& star) {
    const VertexPulse before = pulse[v];
    const OperationId id = record[v].last;
    const Operation& o = source_->at(id);
    touch(star);
    vertex[v].moveBy(-o.offset(0));
    setLast(v, o.child[1]);
    setNext(v, id);
    changeAround(v, star, before);
}

bool ActiveMesh::apply(uint32_t v) {
    const Operation& o = source_->at(record[v].next);
    Star star;
    gatherStars({&v, 1}, &star, [](uint32_t) {});
    if (!mayBeNext(star, v)) return false;
    if (o.isDummy()) return move(v, star), true;
    const uint32_t faces = (o.rankLeft() != kNoRank) + (o.rankRight() != kNoRank);
    const uint32_t u = uint32_t(vertexCount()), first_face = uint32_t(faceCount());
    resize(u + 1, first_face + faces);
    split(v, star, u, {first_face, first_face + 1});
    return true;
}

std::array<uint32_t, 2> ActiveMesh::split(uint32_t v, const Star& star, uint32_t u,
                                          std::array<uint32_t, 2> faces) {
    const OperationId id = record[v].next;
    const Operation& o = source_->at(id);
    const bool has_left = o.rankLeft() != kNoRank, has_right = o.rankRight() != kNoRank;
    const uint32_t n = star.count, l = star.placeOf(o.rankLeft()), r = star.placeOf(o.rankRight());
    // A triangle of the star by its place; beyond an open fan's ends there is none.
    const auto triangle = [&](uint32_t i) {
        if (i < n) return star.corner[i];
        return star.closed ? star.corner[i == n ? 0 : n - 1] : kNoCorner;
    };
    const uint32_t vl = has_left ? star.neighbour[l] : 0;
    const uint32_t vr = has_right ? star.neighbour[r] : 0;
    touch(star);
    const uint32_t chunk = face[star.corner[0] >> 2].chunk();

    const uint32_t begin = has_right ? r : 0, end = has_left ? l : n;
    for (uint32_t i = begin, left = end >= begin ? end - begin : n - begin + end; left > 0;
         --left) {
        setVertexAt(star.corner[i], u);
        if (++i == n) i = 0;
    }
    const uint32_t fl = 4 * faces[0], fr = 4 * faces[has_left ? 1 : 0];
    if (has_left) {
        const uint32_t of_u = triangle(l - 1), of_v = triangle(l);
        face[fl >> 2].vertex = {v, u, vl, v};
        face[fl >> 2].left[3] = chunk;
        link(fl, has_right ? fr : kNoCorner);
        link(fl + 1, of_u == kNoCorner ? kNoCorner : previousCorner(of_u));
        link(fl + 2, of_v);
        if (of_v == kNoCorner) corner(vl).store(fl + 2, kRelaxed);
    }
    if (has_right) {
        const uint32_t of_v = triangle(r - 1), of_u = triangle(r);
        face[fr >> 2].vertex = {u, v, vr, u};
        face[fr >> 2].left[3] = chunk;
        if (!has_left) link(fr, kNoCorner);
        link(fr + 1, of_v == kNoCorner ? kNoCorner : previousCorner(of_v));
        link(fr + 2, of_u);
        if (of_u == kNoCorner) corner(vr).store(fr + 2, kRelaxed);
    }
    const VertexPulse before = pulse[v];
    VertexPulse& a = pulse[v];
    VertexPulse& b = pulse[u];
    a.corner = has_left ? fl : fr + 1;
    b.corner = has_left ? fl + 1 : fr;
    if (!star.closed) a.corner = firstCorner(a.corner), b.corner = firstCorner(b.corner);

    b.name = source_->nameOf(id);
    record[u].undo_last = record[v].last;
    record[u].undo_normal = uint16_t(vertex[v].normal);
    vertex[u] = vertex[v];
    vertex[u].moveBy(o.offset(1));
    vertex[u].normal = o.normal[1];
    vertex[v].moveBy(o.offset(0));
    vertex[v].normal = o.normal[0];
    setLast(v, id);
    setLast(u, id);
    setNext(v, o.child[0]);
    setNext(u, o.child[1]);

    // Counter-clockwise, from vr to vl lie u's neighbours, from vl to vr those of v.
    const uint32_t ring = star.neighbours();
    const auto arc = [ring](uint32_t from, uint32_t to) {  // both included
        const uint32_t until = (2u << to) - 1, before_from = (1u << from) - 1;
        return from <= to ? until & ~before_from : ((1u << ring) - 1) & (until | ~before_from);
    };
    const uint32_t of_v = arc(has_left ? l : 0, has_right ? r : ring - 1);
    const uint32_t of_u = arc(has_right ? r : 0, has_left ? l : ring - 1);
    changeAround(star, before, a, of_v, b, of_u);
    return {of_v, of_u};
}

/// The one that was `before` has become a and b, whose neighbours are told by bits.
void ActiveMesh::changeAround(const Star& star, const VertexPulse& before, VertexPulse& a,
                              uint32_t of_a, VertexPulse& b, uint32_t of_b) {
    // In loops that become vector instructions.
    constexpr uint32_t kRing = kMaxNeighbours + 1;
    std::array<int16_t, kRing> next{}, last{}, at_a, at_b, lower, higher;
    for (uint32_t i = 0; i < star.neighbours(); ++i) {
        next[i] = int16_t(pulse[star.neighbour[i]].next_level);
        last[i] = int16_t(pulse[star.neighbour[i]].last_level);
    }
    for (uint32_t i = 0; i < kRing; ++i) {
        at_a[i] = uint16_t(of_a) & uint16_t(1u << i) ? 1 : 0;
        at_b[i] = uint16_t(of_b) & uint16_t(1u << i) ? 1 : 0;
    }
    const auto count = [&](auto& change, const auto& level, auto&& weighs, int16_t level_a,
                           int16_t level_b, int16_t level_before) {
        int16_t around_a = weighs(level_b, level_a), around_b = weighs(level_a, level_b);
        for (uint32_t i = 0; i < kRing; ++i) {
            change[i] =
                int16_t((weighs(level_a, level[i]) & at_a[i]) +
                        (weighs(level_b, level[i]) & at_b[i]) - weighs(level_before, level[i]));
            around_a = int16_t(around_a + (weighs(level[i], level_a) & at_a[i]));
            around_b = int16_t(around_b + (weighs(level[i], level_b) & at_b[i]));
        }
        return std::pair(uint32_t(around_a), uint32_t(around_b));
    };
    const auto [lower_a, lower_b] = count(
        lower, next, [](int16_t x, int16_t y) { return int16_t(x < y); }, int16_t(a.next_level),
        int16_t(b.next_level), int16_t(before.next_level));
    const auto [higher_a, higher_b] = count(
        higher, last, [](int16_t x, int16_t y) { return int16_t(x > y); }, int16_t(a.last_level),
        int16_t(b.last_level), int16_t(before.last_level));
    for (uint32_t i = 0; i < star.neighbours(); ++i)
        addAround(star.neighbour[i], uint32_t(lower[i]) + (uint32_t(higher[i]) << 16));
    a.around = lower_a + (higher_a << 16);
    b.around = lower_b + (higher_b << 16);
}

std::array<uint32_t, 2> ActiveMesh::merge(uint32_t v, const Star& star, uint32_t u,
                                          const Star& other) {
    VertexPulse& a = pulse[v];
    VertexPulse& b = pulse[u];
    const VertexPulse before = a;
    const bool open = !star.closed || !other.closed;
    touch(star);
    touch(other);
    const uint32_t n = other.count, ring = other.neighbours();
    uint32_t at = 0;
    while (other.neighbour[at] != v) ++at;
    for (uint32_t i = 0; i < n; ++i) setVertexAt(other.corner[i], v);
    const bool has_left = other.closed || at > 0, has_right = other.closed || at < n;
    const uint32_t fl = has_left ? previousCorner(other.corner[(at + n - 1) % n]) : kNoCorner;
    const uint32_t fr = has_right ? other.corner[at] : kNoCorner;
    uint32_t stays = kNoCorner, vl = kNoCorner, vr = kNoCorner;
    if (has_left) {
        const uint32_t of_u = twinOf(fl + 1), of_v = twinOf(fl + 2);
        vl = vertexAt(fl + 2);
        link(of_u, of_v);
        if (corner(vl).load(kRelaxed) == fl + 2) corner(vl).store(of_u, kRelaxed);
        stays = of_v != kNoCorner ? of_v : nextCorner(of_u);
    }
    if (has_right) {
        const uint32_t of_v = twinOf(fr + 1), of_u = twinOf(fr + 2);
        vr = vertexAt(fr + 2);
        link(of_v, of_u);
        if (corner(vr).load(kRelaxed) == fr + 2) corner(vr).store(of_v, kRelaxed);
        if (!has_left) stays = of_u != kNoCorner ? of_u : nextCorner(of_v);
    }
    a.corner = open ? firstCorner(stays) : stays;

    const OperationId id = record[v].last;
    vertex[v].moveBy(-source_->at(id).offset(0));
    vertex[v].normal = record[u].undo_normal;
    setLast(v, record[u].undo_last);
    setNext(v, id);

    uint32_t around = 0;
    for (uint32_t i = 0; i < star.neighbours(); ++i) {
        const uint32_t w = star.neighbour[i];
        if (w == u) continue;
        addAround(w, a.weightOn(pulse[w]) - before.weightOn(pulse[w]));
        around += pulse[w].weightOn(a);
        if (!open && pulse[w].last_level == a.last_level)
            a.corner = star.corner[w != vr ? i : (i + star.count - 1) % star.count];
    }
    for (uint32_t i = 0; i < ring; ++i) {
        const uint32_t w = other.neighbour[i];
        if (w == v) continue;
        const bool new_at_v = w != vl && w != vr;
        addAround(w, (new_at_v ? a.weightOn(pulse[w]) : 0) - b.weightOn(pulse[w]));
        if (!new_at_v) continue;
        around += pulse[w].weightOn(a);
        if (!open && pulse[w].last_level == a.last_level) a.corner = other.corner[i];
    }
    a.around = around;
    b.name = kNoCorner;
    return {fl == kNoCorner ? fl : fl >> 2, fr == kNoCorner ? fr : fr >> 2};
}

namespace {

/// Pairs the elements at or beyond `count` that stay with the holes below it: the elements go to
/// `from`, in increasing order, and `free` keeps the holes, in its order.
void pairWithHoles(std::vector<uint32_t>& free, size_t count, size_t size,
                   std::vector<uint32_t>& from) {
    std::vector<uint8_t> gone(size - count, 0);
    for (const uint32_t f : free)
        if (f >= count) gone[f - count] = 1;
    std::erase_if(free, [&](uint32_t f) { return f >= count; });
    from.clear();
    for (size_t i = count; i < size; ++i)
        if (!gone[i - count]) from.push_back(uint32_t(i));
    CHECK_EQ(from.size(), free.size());
}

}  // namespace

void ActiveMesh::fillHoles(std::vector<uint32_t>& free_vertices,
                           std::vector<uint32_t>& free_faces) {
    const size_t vertices = vertexCount() - free_vertices.size();
    const size_t faces = faceCount() - free_faces.size();
    std::vector<uint32_t> from;
    pairWithHoles(free_faces, faces, faceCount(), from);
    moveFaces(from, free_faces, faces);
    resize(vertexCount(), faces);
    pairWithHoles(free_vertices, vertices, vertexCount(), from);
    parallelForSlices(from.size(), kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) moveVertex(from[i], free_vertices[i]);
    });
    resize(vertices, faces);
}

void ActiveMesh::moveVertex(uint32_t from, uint32_t to) {
    vertex[to] = vertex[from];
    record[to] = record[from];
    pulse[to] = pulse[from];
    criteria[to] = criteria[from];
    const uint32_t first = pulse[to].corner;
    for (uint32_t c = first; c != kNoCorner;) {
        setVertexAt(c, to);
        c = leftOf(c);
        if (c == first) break;
    }
}

/// Two neighbours may both move: each asks for the other's new place, and tells only neighbours
/// that stay.
void ActiveMesh::moveFaces(const std::vector<uint32_t>& from, const std::vector<uint32_t>& to,
                           size_t count) {
    std::vector<uint32_t> new_place(faceCount() - count);
    for (size_t i = 0; i < from.size(); ++i) new_place[from[i] - count] = to[i];
    parallelForSlices(from.size(), kGrain, [&](size_t begin, size_t end) {
        for (size_t i = begin; i < end; ++i) {
            face[to[i]].left[3] = face[from[i]].chunk();
            for (uint32_t k = 0; k < 3; ++k) {
                const uint32_t old_corner = 4 * from[i] + k, new_corner = 4 * to[i] + k;
                const uint32_t v = vertexAt(old_corner), t = twinOf(old_corner);
                setVertexAt(new_corner, v);
                if (corner(v).load(kRelaxed) == old_corner) corner(v).store(new_corner, kRelaxed);
                if (t == kNoCorner || t >> 2 < count) {
                    link(new_corner, t);
                } else {
                    setTwin(new_corner, 4 * new_place[(t >> 2) - count] + (t & 3));
                }
            }
        }
    });
}

void ActiveMesh::sortInSpace() {
    Box3i box;
    for (const Vertex& v : vertex) box.add(v.position());
    const Vec3i size = box.max - box.min;
    const int shift =
        std::max(int(std::bit_width(uint32_t(std::max({size.x, size.y, size.z})))) - 6, 0);
    const std::vector<uint32_t> place =
        placesByKey(source_->base_vertex.size(), vertexCount(), 1 << 18, [&](uint32_t v) {
            const Vec3i p = (vertex[v].position() - box.min) >> shift;
            return spread(uint32_t(p.x)) | spread(uint32_t(p.y)) << 1 | spread(uint32_t(p.z)) << 2;
        });
    const std::vector<uint32_t> face_place =
        placesByKey(source_->base_triangle.size(), faceCount(), vertexCount(), [&](uint32_t f) {
            const auto& v = face[f].vertex;
            return std::min({place[v[0]], place[v[1]], place[v[2]]});
        });
    const auto moved = [&](uint32_t& corner) {
        if (corner != kNoCorner) corner = 4 * face_place[corner >> 2] + (corner & 3);
    };
    parallelForSlices(faceCount(), 16 * kGrain, [&](size_t begin, size_t end) {
        for (size_t f = begin; f < end; ++f)
            for (size_t k = 0; k < 3; ++k) {
                setVertexAt(uint32_t(4 * f + k), place[face[f].vertex[k]]);
                moved(face[f].left[k]);
            }
    });
    for (VertexPulse& p : pulse) moved(p.corner);
    permute(vertex, place);
    permute(pulse, place);
    permute(criteria, place);
    permute(record, place);
    permute(face, face_place);
}

std::string validateStars(const ProgressiveMesh& mesh) {
    ActiveMesh active(mesh);
    std::vector<uint32_t> vertex_of(mesh.operation.size());
    for (uint32_t v = 0; v < active.vertexCount(); ++v)
        if (active.record[v].next != kNoOperation) vertex_of[active.record[v].next] = v;
    for (const OperationId id : coarseToFine(mesh)) {
        const Operation& o = mesh.operation[id];
        const uint32_t v = vertex_of[id];
        if (active.pulse[v].corner == kNoCorner)
            return fmt::format("operation {}: its vertex has no triangles", id);
        if (!active.allNeighbours(v,
                                  [&](uint32_t w) { return active.pulse[w].next_level > o.level; }))
            return fmt::format("operation {}: a neighbour does not split after it", id);
        if (!active.apply(v)) return fmt::format("operation {}: its ranks do not fit its star", id);
        for (const int end : {0, 1})
            if (o.childOf(end) != kNoOperation)
                vertex_of[o.childOf(end)] = end == 0 ? v : uint32_t(active.vertexCount() - 1);
    }
    return "";
}

}  // namespace pietra::pmesh
