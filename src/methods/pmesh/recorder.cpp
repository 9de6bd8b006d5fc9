#include "methods/pmesh/recorder.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace pietra::pmesh {

Recorder::Recorder(const Mesh& mesh, std::span<const uint8_t> irregular, int shift)
    : irregular_(irregular),
      shift_(shift),
      normal_(mesh.normal),
      history_(mesh.vertexCount()),
      leaves_(mesh.triangleCount(), FaceLeaves{}),
      closed_(mesh.triangleCount(), 1),
      map_(std::vector<float>(mesh.triangleCount(), 0), {}),
      layout_(WordLayout::of(mesh)) {}

Recorder::Recorder(const Mesh& mesh, std::vector<VertexHistory> history,
                   const std::vector<float>& bound, std::vector<FaceLeaves> leaves,
                   std::vector<uint8_t> closed, const SurfaceMap::Effort& effort,
                   uint32_t first_record, int shift)
    : shift_(shift),
      normal_(mesh.normal),
      history_(std::move(history)),
      leaves_(std::move(leaves)),
      closed_(std::move(closed)),
      map_(bound, effort),
      largest_error_(*std::max_element(bound.begin(), bound.end())),
      first_record_(first_record),
      layout_(WordLayout::of(mesh)) {}

void Recorder::limitHeights(uint32_t more) {
    uint32_t largest = largest_;
    for (const VertexHistory& h : history_) largest = std::max(largest, h.height);
    most_height_ = std::min(largest + more, kMostHeight);
}

Vec3i Recorder::stepsOf(const WorkingMesh& mesh, const Vec3f& p) const {
    return (mesh.centre + Vec3i(p)) >> shift_;
}

void Recorder::addWords(const CollapseStep& step, uint32_t vertex) {
    if (layout_.words() == 0) return;
    step.attributes.resizeOutput(one_, 1);
    step.attributes.store(vertex, one_, 0);
    appendWords(one_, 0, layout_, words_);
}

/// The triangles that remain, one after the other around the merged vertex.
Recorder::OrderedRing Recorder::orderedRing(const Ring& ring) {
    OrderedRing r;
    const auto find = [&](const auto& of, uint32_t w) {
        uint32_t i = 0;
        while (i < ring.size && of[i] != w) ++i;
        return i;
    };
    uint32_t first = 0;
    while (first < ring.size && find(ring.previous, ring.next[first]) < ring.size) ++first;
    r.closed = first == ring.size;
    if (r.closed) first = 0;
    r.vertex[r.size++] = ring.next[first];
    uint32_t i = first;
    for (uint32_t n = 1; n < ring.size; ++n) {
        r.vertex[r.size++] = ring.previous[i];
        i = find(ring.next, ring.previous[i]);
        CHECK_LT(i, ring.size);
    }
    if (!r.closed) r.vertex[r.size++] = ring.previous[i];
    return r;
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
bool Recorder::mapOn(const CollapseStep& step, const OrderedRing& ring, CollapseRecord& r) {
    const WorkingMesh& mesh = step.mesh;
    CollapsingStar star;
    star.size = ring.size;
    star.closed = ring.closed;
    star.merged = step.to;
    star.end = {mesh.point[step.v].vec(), mesh.point[step.u].vec()};
    star.on_border = {mesh.point[step.v].rank() != kRankFree,
                      mesh.point[step.u].rank() != kRankFree};
    const auto placeInRing = [&](uint32_t w) {
        return uint32_t(std::find(ring.vertex.begin(), ring.vertex.begin() + ring.size, w) -
                        ring.vertex.begin());
    };
    for (uint32_t i = 0; i < ring.size; ++i) star.ring[i] = mesh.point[ring.vertex[i]].vec();
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
    const float stated = r.error;
    if (!map_.collapse(star, stated, largest_error_)) return false;
    const NormalBox normals = normalsOf(star);
    r.closed = spreadClosed(star);
    if (r.closed && !normals.empty()) r.normals = normals;
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

/// Its own part, and what those that it depends on state.
void Recorder::enclose(const CollapseStep& step, const OrderedRing& ring, CollapseRecord& r) const {
    uint32_t height = 0;
    const auto add = [&](uint32_t vertex) {
        const VertexHistory& h = history_[vertex];
        r.box.add(stepsOf(step.mesh, step.mesh.point[vertex].vec()));
        r.box.add(h.box);
        r.error = std::max(r.error, h.error);
        r.normals.add(h.normals);
        height = std::max(height, h.height);
    };
    add(step.v);
    add(step.u);
    for (uint32_t i = 0; i < ring.size; ++i) add(ring.vertex[i]);
    r.box.add(r.merged);
    r.height = uint16_t(height + 1);
}

/// What was u's leaves come after v's.
void Recorder::removeFaces(const CollapseStep& step, CollapseRecord& r) {
    for (uint32_t i = 0; i < step.ring.size; ++i)
        if (step.ring.apex[i] == step.u)
            leaves_[step.ring.corner[i] >> 2][step.ring.corner[i] & 3] += r.leaves[0];
    for (const Wing& w : step.wing) {
        const auto& corner = step.mesh.face[w.face].v;
        const FaceLeaves& leaves = leaves_[w.face];
        const uint32_t k = corner[0] == step.v ? 0 : corner[1] == step.v ? 1 : 2;
        const uint32_t next = kNextCorner[k], last = kNextCorner[next];
        const bool left = corner[next] == step.u;
        CollapseWing& wing = r.wing[left ? 0 : 1];
        CHECK_EQ(wing.vertex, kNoVertex);
        wing.vertex = w.vertex;
        wing.offset = {leaves[k], leaves[left ? next : last], leaves[left ? last : next]};
    }
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

    const OrderedRing ring = orderedRing(step.ring);
    CollapseRecord r{};
    r.position = {stepsOf(step.mesh, step.mesh.point[v].vec()),
                  stepsOf(step.mesh, step.mesh.point[u].vec())};
    r.merged = stepsOf(step.mesh, step.to);
    r.normals = NormalBox::none();
    enclose(step, ring, r);
    if (r.height > most_height_) return ++refused_.level, false;
    const NormalBox around = r.normals;
    r.normals = NormalBox();
    if (!mapOn(step, ring, r)) return ++refused_.unseen, false;
    r.normals.add(around);
    const float error = map_.largestOfLast();
    largest_error_ = std::max(largest_error_, error);
    r.error = std::max({r.error, error, float(kLeastError * double(1 << shift_))});
    r.leaves = {history_[v].operations + 1, history_[u].operations + 1};
    removeFaces(step, r);
    addWords(step, v);
    addWords(step, u);
    r.normal = {packNormal(normal_[v]), packNormal(normal_[u])};
    normal_[v] = encodeNormal(decodeNormal(normal_[v]) + decodeNormal(normal_[u]));
    const uint32_t operations = r.leaves[0] + r.leaves[1] - 1;
    link_.push_back({u, {history_[v].last, history_[u].last}, operations, r.error, r.box});
    largest_ = std::max(largest_, uint32_t(r.height));
    history_[v] = {
        first_record_ + uint32_t(record_.size()), r.height, operations, r.error, r.box, r.normals};
    record_.push_back(r);
    return true;
}

}  // namespace pietra::pmesh
