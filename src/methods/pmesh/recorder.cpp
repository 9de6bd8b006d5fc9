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
      error_before_(mesh.vertexCount(), 0) {}

Recorder::Recorder(const Mesh& mesh, std::vector<VertexHistory> history, uint32_t first_record,
                   int shift)
    : shift_(shift),
      normal_(mesh.normal),
      history_(std::move(history)),
      first_record_(first_record) {
    for (const VertexHistory& h : history_) error_before_.push_back(h.error);
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

void Recorder::push(const CollapseRecord& record) {
    largest_ = std::max(largest_, record.height);
    VertexHistory& h = history_[record.v];
    h.last = first_record_ + uint32_t(record_.size());
    h.height = record.height;
    h.error = std::max(h.error, record.deviation);
    record_.push_back(record);
}

void Recorder::recordDummy(const CollapseStep& step, uint32_t end) {
    CollapseRecord r;
    r.v = end;
    r.position[0] = stepsOf(step.mesh, step.mesh.point[end].vec());
    r.normal[0] = packNormal(normal_[end]);
    r.child = {history_[end].last, kNoOperation};
    r.height = 0;
    forEdges(step, [&](uint32_t a, uint32_t b) {
        if (a == end || b == end) r.height = std::max({r.height, heightOf(a), heightOf(b)});
    });
    ++r.height;
    r.deviation = 0;
    ++dummies_;
    push(r);
}

bool Recorder::take(const CollapseStep& step) {
    const uint32_t u = step.u, v = step.v;
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
    if (highest + 3 > kMaxLevel + 1) return ++refused_.level, false;  // two dummies and itself

    CollapseRecord r;
    r.v = v, r.u = u;
    for (const Wing& w : step.wing) {
        const Face& face = step.mesh.face[w.face];
        const uint32_t k = face.v[0] == v ? 0 : face.v[1] == v ? 1 : 2;
        (face.v[kNextCorner[k]] == u ? r.left : r.right) = w.vertex;
    }
    const Vec3i to = stepsOf(step.mesh, step.to);
    r.position = {stepsOf(step.mesh, step.mesh.point[v].vec()),
                  stepsOf(step.mesh, step.mesh.point[u].vec())};
    const uint32_t shift = quantiseOffsets({r.position[0] - to, r.position[1] - to}).shift;
    const float lost = shift == 0 ? 0 : float(1 << (shift - 1)) * float(1 << shift_);
    for (const uint32_t end : {v, u})
        if (lost > 0 && lost > precisionAt(step, end)) recordDummy(step, end);
    r.height = 1 + std::max({highest, heightOf(u), heightOf(v)});
    r.normal = {packNormal(normal_[v]), packNormal(normal_[u])};
    r.child = {history_[v].last, history_[u].last};
    error_before_[v] = std::max(error_before_[v], error_before_[u]);
    r.deviation = step.deviation + error_before_[v];
    normal_[v] = encodeNormal(decodeNormal(normal_[v]) + decodeNormal(normal_[u]));
    push(r);
    return true;
}

}  // namespace pietra::pmesh
