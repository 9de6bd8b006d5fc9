#include "methods/pmesh/recorder.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace pietra::pmesh {
namespace {

/// A coordinate is off by half of 2^shift at most; that may be so large a part of the shortest
/// edge.
constexpr float kMostImprecise = 1.0f / 8;

}  // namespace

QuantisedOffsets quantiseOffsets(const std::array<Vec3i, 2>& offset) {
    QuantisedOffsets q;
    const auto rounded = [&](int32_t x) { return (x + ((1 << q.shift) >> 1)) >> q.shift; };
    const auto fits = [&] {
        for (const Vec3i& d : offset)
            for (int k = 0; k < 3; ++k)
                if (rounded(d[k]) < -127 || rounded(d[k]) > 127) return false;
        return true;
    };
    while (!fits()) ++q.shift;
    for (size_t end = 0; end < 2; ++end)
        for (int k = 0; k < 3; ++k) q.delta[end][size_t(k)] = int8_t(rounded(offset[end][k]));
    return q;
}

Recorder::Recorder(const Mesh& mesh, std::span<const uint8_t> irregular, int shift)
    : irregular_(irregular),
      shift_(shift),
      normal_(mesh.normal),
      history_(mesh.vertexCount()),
      closed_(mesh.triangleCount(), 1),
      map_(std::vector<float>(mesh.triangleCount(), 0), {}),
      layout_(WordLayout::of(mesh)) {}

Recorder::Recorder(const Mesh& mesh, std::vector<VertexHistory> history,
                   const std::vector<float>& bound, std::vector<uint8_t> closed,
                   const SurfaceMap::Effort& effort, uint32_t first_record, int shift)
    : shift_(shift),
      normal_(mesh.normal),
      history_(std::move(history)),
      closed_(std::move(closed)),
      map_(bound, effort),
      largest_error_(*std::max_element(bound.begin(), bound.end())),
      first_record_(first_record),
      layout_(WordLayout::of(mesh)) {}

void Recorder::limitHeights(uint32_t more) {
    uint32_t largest = largest_;
    for (const VertexHistory& h : history_) largest = std::max(largest, h.height);
    most_height_ = std::min(largest + more, kMaxLevel);
}

Vec3i Recorder::stepsOf(const WorkingMesh& mesh, const Vec3f& p) const {
    return (mesh.centre + Vec3i(p)) >> shift_;
}

namespace {

/// body(a, b) for each edge of the step's two ends, some twice.
template <class Body>
void forEdges(const CollapseStep& step, Body&& body) {
    body(step.u, step.v);
    for (uint32_t i = 0; i < step.ring.size; ++i) {
        body(step.ring.apex[i], step.ring.next[i]);
        body(step.ring.apex[i], step.ring.previous[i]);
    }
    for (const Wing& w : step.wing) {
        body(step.u, w.vertex);
        body(step.v, w.vertex);
    }
}

}  // namespace

/// How far off, in lattice units along an axis, this end may come.
float Recorder::precisionAt(const CollapseStep& step, uint32_t end) const {
    float shortest_sq = HUGE_VALF;
    forEdges(step, [&](uint32_t a, uint32_t b) {
        const Vec3f d = step.mesh.point[a].vec() - step.mesh.point[b].vec();
        if (a == end || b == end) shortest_sq = std::min(shortest_sq, glm::dot(d, d));
    });
    return kMostImprecise * std::sqrt(shortest_sq);
}

/// Adds what hangs below to the link, and makes it v's last.
void Recorder::push(uint32_t v, CollapseLink link, CollapseRecord record) {
    link.box.add(record.position[0]);
    if (link.u != CollapseLink::kNone) link.box.add(record.position[1]);
    VertexHistory& h = history_[v];
    const auto addBelow = [&](const VertexHistory& below) {
        link.box.add(below.box);
        link.error = std::max(link.error, below.error);
        link.operations += below.operations;
        record.normals.add(below.normals);
    };
    addBelow(h);
    if (link.u != CollapseLink::kNone) addBelow(history_[link.u]);
    record.error = link.error;
    largest_ = std::max(largest_, uint32_t(record.height));
    h = {first_record_ + uint32_t(record_.size()),
         record.height,
         link.operations,
         link.error,
         link.box,
         record.normals};
    link_.push_back(link);
    record_.push_back(record);
}

void Recorder::addWords(const CollapseStep& step, uint32_t vertex) {
    if (layout_.words() == 0) return;
    step.attributes.resizeOutput(one_, 1);
    step.attributes.store(vertex, one_, 0);
    appendWords(one_, 0, layout_, words_);
}

/// `normals`: of what the collapse after it finds and makes.
void Recorder::recordDummy(const CollapseStep& step, uint32_t end, const NormalBox& normals) {
    for (int i = 0; i < 2; ++i) addWords(step, end);
    CollapseRecord r{};
    r.normals = normals;
    r.position[0] = stepsOf(step.mesh, step.mesh.point[end].vec());
    r.normal[0] = packNormal(normal_[end]);
    uint32_t height = 0;
    forEdges(step, [&](uint32_t a, uint32_t b) {
        if (a == end || b == end) height = std::max({height, heightOf(a), heightOf(b)});
    });
    r.height = uint16_t(height + 1);
    ++dummies_;
    push(end, {.child = {history_[end].last, kNoOperation}, .box = {}}, r);
}

/// The triangles that remain, one after the other around the merged vertex.
void Recorder::gatherRing(const CollapseStep& step, CollapseRecord& r) const {
    const Ring& ring = step.ring;
    const auto find = [&](const auto& of, uint32_t w) {
        uint32_t i = 0;
        while (i < ring.size && of[i] != w) ++i;
        return i;
    };
    uint32_t first = 0;
    while (first < ring.size && find(ring.previous, ring.next[first]) < ring.size) ++first;
    r.closed = first == ring.size;
    if (r.closed) first = 0;
    r.ring[r.ring_size++] = ring.next[first];
    uint32_t i = first;
    for (uint32_t n = 1; n < ring.size; ++n) {
        r.ring[r.ring_size++] = ring.previous[i];
        i = find(ring.next, ring.previous[i]);
        CHECK_LT(i, ring.size);
    }
    if (!r.closed) r.ring[r.ring_size++] = ring.previous[i];
}

/// Of the faces before and after the collapse; the merged vertex is at 0.
NormalBox normalsOf(const CollapsingStar& star) {
    NormalBox normals = NormalBox::none();
    for (uint32_t i = 0; i < star.edges(); ++i) {
        const Vec3d a(star.ring[i]), b(star.ring[star.after(i)]), end(star.end[star.of_u[i]]);
        normals.add(glm::cross(a, b));
        normals.add(glm::cross(a - end, b - end));
    }
    for (uint32_t w = 0; w < star.wings; ++w) {
        const CollapsingStar::Wing& wing = star.wing[w];
        std::array<Vec3d, 3> at;
        for (const uint32_t end : {0u, 1u}) at[wing.corner[end]] = Vec3d(star.end[end]);
        at[wing.corner[2]] = Vec3d(star.ring[wing.ring]);
        normals.add(glm::cross(at[1] - at[0], at[2] - at[0]));
    }
    return normals;
}

/// Bounds of the faces that the collapse makes, and normals. False: it must not be.
bool Recorder::mapOn(const CollapseStep& step, CollapseRecord& r) {
    const WorkingMesh& mesh = step.mesh;
    CollapsingStar star;
    star.size = r.ring_size;
    star.closed = r.closed;
    star.merged = step.to;
    star.end = {mesh.point[step.v].vec(), mesh.point[step.u].vec()};
    star.on_border = {mesh.point[step.v].rank() != kRankFree,
                      mesh.point[step.u].rank() != kRankFree};
    const auto placeInRing = [&](uint32_t w) {
        return uint32_t(std::find(r.ring.begin(), r.ring.begin() + r.ring_size, w) -
                        r.ring.begin());
    };
    for (uint32_t i = 0; i < r.ring_size; ++i) star.ring[i] = mesh.point[r.ring[i]].vec();
    for (uint32_t i = 0; i < step.ring.size; ++i) {
        const uint32_t edge = placeInRing(step.ring.next[i]);
        CHECK_LT(edge, star.edges());
        star.face[edge] = step.ring.corner[i] >> 2;
        star.apex[edge] = step.ring.corner[i] & 3;
        star.of_u[edge] = step.ring.apex[i] == step.u;
    }
    for (const Wing& w : step.wing) {
        CollapsingStar::Wing& wing = star.wing[star.wings++];
        wing.face = w.face;
        wing.ring = placeInRing(w.vertex);
        const auto& corner = mesh.face[w.face].v;
        for (uint32_t k = 0; k < 3; ++k)
            wing.corner[corner[k] == step.v ? 0 : corner[k] == step.u ? 1 : 2] = k;
    }
    const float stated = std::max(history_[step.u].error, history_[step.v].error);
    if (!map_.collapse(star, stated, largest_error_)) return false;
    const NormalBox normals = normalsOf(star);
    if (spreadClosed(star) && !normals.empty()) r.normals = normals;
    return true;
}

/// Of a component either all is closed or nothing is: what a face of the star knows all of them do.
bool Recorder::spreadClosed(const CollapsingStar& star) {
    bool closed = false;
    const auto forFaces = [&](auto&& body) {
        for (uint32_t i = 0; i < star.edges(); ++i) body(closed_[star.face[i]]);
        for (uint32_t w = 0; w < star.wings; ++w) body(closed_[star.wing[w].face]);
    };
    forFaces([&](uint8_t is_closed) { closed |= is_closed != 0; });
    forFaces([&](uint8_t& is_closed) { is_closed = closed; });
    return closed;
}

bool Recorder::take(const CollapseStep& step) {
    const uint32_t u = step.u, v = step.v;
    for (size_t w = inside_.size(); w < history_.size(); ++w)
        inside_.push_back(step.mesh.point[w].rank() != kRankFixed);
    const uint32_t rank = std::max(step.mesh.point[u].rank(), step.mesh.point[v].rank());
    if (rank == kRankFixed || (!irregular_.empty() && (irregular_[u] || irregular_[v])))
        return ++refused_.irregular, false;
    const bool open = rank != kRankFree;
    if (step.ring.size + open > kMaxNeighbours) return ++refused_.valence, false;
    CHECK_EQ(step.wing.size() + (open && step.wing.size() == 1), size_t(2));
    uint32_t highest = 0;
    forEdges(step, [&](uint32_t a, uint32_t b) {
        highest = std::max({highest, heightOf(a), heightOf(b)});
    });
    if (highest + 3 > most_height_ + 1) return ++refused_.level, false;  // two dummies and itself

    CollapseRecord r{};
    gatherRing(step, r);
    for (const Wing& w : step.wing) {
        const Face& face = step.mesh.face[w.face];
        const uint32_t k = face.v[0] == v ? 0 : face.v[1] == v ? 1 : 2;
        uint8_t rank = 0;
        while (rank < r.ring_size && r.ring[rank] != w.vertex) ++rank;
        CHECK_LT(rank, r.ring_size);
        (face.v[kNextCorner[k]] == u ? r.left : r.right) = rank;
    }
    if (!mapOn(step, r)) return ++refused_.unseen, false;
    const float error = map_.largestOfLast();
    largest_error_ = std::max(largest_error_, error);
    const Vec3i to = stepsOf(step.mesh, step.to);
    r.position = {stepsOf(step.mesh, step.mesh.point[v].vec()),
                  stepsOf(step.mesh, step.mesh.point[u].vec())};
    for (uint32_t i = 0; i < r.ring_size; ++i) {
        const Vec3d d(stepsOf(step.mesh, step.mesh.point[r.ring[i]].vec()) - to);
        r.radius = std::max(r.radius, uint32_t(std::ceil(std::sqrt(glm::dot(d, d)))));
    }
    const uint32_t shift = quantiseOffsets({r.position[0] - to, r.position[1] - to}).shift;
    const float lost = shift == 0 ? 0 : float(1 << (shift - 1)) * float(1 << shift_);
    for (const uint32_t end : {v, u})
        if (lost > 0 && lost > precisionAt(step, end)) recordDummy(step, end, r.normals);
    addWords(step, v);
    addWords(step, u);
    r.height = uint16_t(1 + std::max({highest, heightOf(u), heightOf(v)}));
    r.normal = {packNormal(normal_[v]), packNormal(normal_[u])};
    normal_[v] = encodeNormal(decodeNormal(normal_[v]) + decodeNormal(normal_[u]));
    push(v, {u, {history_[v].last, history_[u].last}, 1, error, {}}, r);
    return true;
}

}  // namespace pietra::pmesh
