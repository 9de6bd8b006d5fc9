#include "methods/pmesh/recorder.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"

namespace pietra::pmesh {
namespace {

/// A coordinate is off by half of 2^shift at most; that may be so large a part of the shortest
/// edge.
constexpr float kMostImprecise = 1e9f;

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
      last_(mesh.vertexCount(), kNoOperation) {}

Vec3i Recorder::stepsOf(const WorkingMesh& mesh, const Vec3f& p) const {
    return (mesh.centre + Vec3i(p)) >> shift_;
}

uint32_t Recorder::heightAround(const CollapseStep& step) const {
    uint32_t highest = std::max(heightOf(step.u), heightOf(step.v));
    for (uint32_t i = 0; i < step.ring.size; ++i)
        highest = std::max({highest, heightOf(step.ring.next[i]), heightOf(step.ring.previous[i])});
    return highest;
}

bool Recorder::isPrecise(const CollapseStep& step, const std::array<Vec3i, 2>& offset) const {
    const uint32_t shift = quantiseOffsets(offset).shift;
    if (shift == 0) return true;
    const auto length_sq = [&](uint32_t a, uint32_t b) {
        const Vec3f d = step.mesh.point[a].vec() - step.mesh.point[b].vec();
        return glm::dot(d, d);
    };
    float shortest_sq = length_sq(step.u, step.v);
    for (uint32_t i = 0; i < step.ring.size; ++i)
        shortest_sq = std::min({shortest_sq, length_sq(step.ring.apex[i], step.ring.next[i]),
                                length_sq(step.ring.apex[i], step.ring.previous[i])});
    const float limit = kMostImprecise * std::sqrt(shortest_sq);
    return float(1u << shift) / 2 * float(1 << shift_) <= limit;
}

bool Recorder::take(const CollapseStep& step) {
    const uint32_t u = step.u, v = step.v;
    if (irregular_[u] || irregular_[v]) return ++refused_.irregular, false;
    const bool open =
        step.mesh.point[u].rank() != kRankFree || step.mesh.point[v].rank() != kRankFree;
    if (step.ring.size + open > kMaxNeighbours) return ++refused_.valence, false;
    CHECK_EQ(step.wing.size() + (open && step.wing.size() == 1), size_t(2));

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
    if (!isPrecise(step, {r.position[0] - to, r.position[1] - to}))
        return ++refused_.imprecise, false;
    r.height = heightAround(step) + 1;
    if (r.height > kMaxLevel + 1) return ++refused_.level, false;
    largest_ = std::max(largest_, r.height);
    r.normal = {packNormal(normal_[v]), packNormal(normal_[u])};
    r.child = {last_[v], last_[u]};
    r.deviation = step.deviation;
    normal_[v] = encodeNormal(decodeNormal(normal_[v]) + decodeNormal(normal_[u]));
    last_[v] = uint32_t(record_.size());
    record_.push_back(r);
    return true;
}

}  // namespace pietra::pmesh
