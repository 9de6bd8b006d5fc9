#include "simplify/collapse_loop.h"

#include <algorithm>
#include <cmath>

namespace pietra {
namespace {

/// Share of the square of the largest distance in the cost, beside the mean square: 0 lets spikes
/// be cut off (twice the dragon's triangles at an error of a thousandth of its size), 1 has as many
/// triangles as 0 where the surface is smooth, a fifth more than 1/4.
constexpr float kLargestShare = 0.25f;
/// Of the error that is stated anyhow, what a collapse below the quotas may cost, as a root mean
/// square: a diamond's largest distance is some three times that. 0.5 needs up to a third more
/// triangles for a given error.
constexpr float kFreePart = 0.3f;
/// Candidates between what is being looked at and what is fetched.
constexpr uint32_t kAhead = 2;
/// See kMinShape: a height of about 1/600 of the longest edge.
constexpr float kMinShapeWhenStuck = 3e-6f;

}  // namespace

void CollapseLoop::run(const SnapGrid& grid, float free_error, CollapseSink* sink) {
    grid_ = grid;
    sink_ = sink;
    queue_.clear();
    collapses_ = 0;
    worst_deviation_sq_ = 0;
    fillPositions();
    runRounds(kMinShape);
    if (mesh_.cells_above > 0) runRounds(kMinShapeWhenStuck);
    if (worstDeviation() < kFreePart * free_error) collapseFreely(kFreePart * free_error);
}

/// Whatever the quotas say: collapses that cost no more than is lost anyhow.
void CollapseLoop::collapseFreely(float deviation) {
    collapser_.setFree(true);
    collapser_.setMinShape(kMinShape);
    limit_sq_ = deviation * deviation;
    queue_.clear();
    pushAllEdges();
    while (queue_.lowestBucket() != CollapseQueue::kNoBucket) {
        popCandidates();
        collapseCandidates();
    }
    limit_sq_ = HUGE_VALF;
    collapser_.setFree(false);
}

// What was rejected may be allowed when its surroundings have changed: so again, until nothing is.
void CollapseLoop::runRounds(float min_shape) {
    collapser_.setMinShape(min_shape);
    for (uint32_t before = ~0u; mesh_.cells_above > 0 && before != collapses_;) {
        before = collapses_;
        queue_.clear();
        pushAllEdges();
        while (wanted() && queue_.lowestBucket() != CollapseQueue::kNoBucket) {
            popCandidates();
            collapseCandidates();
        }
    }
}

void CollapseLoop::fillPositions() {
    positions_.reset(2 * mesh_.point.size());
    for (uint32_t v = 0; v < mesh_.point.size(); ++v)
        if (!mesh_.point[v].dead()) positions_.insert(mesh_, v);
}

/// Fills the lanes beyond `count`, which must not be 0, and evaluates.
void CollapseLoop::place(EdgeBatch& edges, uint32_t count) const {
    for (uint32_t i = count; i < kBatch; ++i) {
        edges.u[i] = edges.u[0];
        edges.v[i] = edges.v[0];
    }
    kernels_.place(mesh_.point.data(), mesh_.quadric.data(), attributes_.view(), grid_, edges);
}

void CollapseLoop::pushEdge(uint32_t u, uint32_t v) {
    pending_.u[pending_count_] = u;
    pending_.v[pending_count_] = v;
    __builtin_prefetch(&mesh_.quadric[v]);
    if (++pending_count_ == kBatch) flushPending();
}

void CollapseLoop::flushPending() {
    if (pending_count_ == 0) return;
    place(pending_, pending_count_);
    for (uint32_t i = 0; i < pending_count_; ++i) {
        const uint32_t u = pending_.u[i], v = pending_.v[i];
        const uint32_t stamp = mesh_.stamp[u] + mesh_.stamp[v];
        if (stamp < WorkingMesh::kDeadStamp && pending_.cost[i] <= limit_sq_ * weightOf(u, v))
            queue_.push(pending_.cost[i], {u, v, stamp});
    }
    pending_count_ = 0;
}

/// Each edge once where triangles are plain; irregular ones maybe twice, which does no harm.
void CollapseLoop::pushAllEdges() {
    for (const Face& face : mesh_.face) {
        if (face.dead()) continue;
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t u = face.v[k], v = face.v[kNextCorner[k]];
            const uint32_t shared_flags = mesh_.point[u].flags & mesh_.point[v].flags;
            if (u > v && !(shared_flags & kIrregularFlag)) continue;
            if (collapsibleEdge(mesh_, face, k)) pushEdge(u, v);
        }
    }
    flushPending();
}

/// The edges of `v`, whose ring the collapser has just read.
void CollapseLoop::pushEdgesAround(uint32_t v) {
    const Ring& ring = collapser_.ring();
    const uint32_t epoch = mesh_.epoch += 2;
    const auto visit = [&](uint32_t w, const Face& face, uint32_t edge) {
        if (mesh_.mark[w] == epoch) return;
        mesh_.mark[w] = epoch;
        if (collapsibleEdge(mesh_, face, edge)) pushEdge(v, w);
    };
    for (uint32_t i = 0; i < ring.size; ++i) {
        const Face& face = mesh_.face[ring.corner[i] >> 2];
        const uint32_t k = ring.corner[i] & 3;
        visit(ring.next[i], face, k);
        visit(ring.previous[i], face, kPreviousCorner[k]);
    }
}

/// Edges of the lowest bucket as they are now, up to a batch; fewer, or none, where it has no more.
void CollapseLoop::popCandidates() {
    Candidates& batch = candidates_;
    batch.count = 0;
    const uint32_t bucket = current_bucket_ = queue_.lowestBucket();
    while (batch.count < kBatch && !queue_.empty(bucket)) {
        const CollapseQueue::Entry e = queue_.pop(bucket);
        if (!stillThere(e.u, e.v, e.stamp)) continue;
        const bool swap = mesh_.point[e.u].rank() > mesh_.point[e.v].rank();
        batch.edges.u[batch.count] = swap ? e.v : e.u;
        batch.edges.v[batch.count] = swap ? e.u : e.v;
        batch.stamp[batch.count++] = e.stamp;
        __builtin_prefetch(&mesh_.fan[e.u]);
        __builtin_prefetch(&mesh_.fan[e.v]);
        __builtin_prefetch(&mesh_.quadric[e.u]);
        __builtin_prefetch(&mesh_.quadric[e.v]);
    }
}

void CollapseLoop::prefetchCandidates() const {
    const EdgeBatch& edges = candidates_.edges;
    for (uint32_t i = 0; i < candidates_.count; ++i) {
        for (const uint32_t v : {edges.u[i], edges.v[i]}) {
            __builtin_prefetch(&mesh_.corner[mesh_.fan[v].begin]);
            attributes_.prefetch(v);
        }
        positions_.prefetch({edges.x[i], edges.y[i], edges.z[i]});
    }
    for (uint32_t i = 0; i < candidates_.count; ++i)
        forFaces(i, [&](uint32_t f) {
            __builtin_prefetch(&mesh_.face[f]);
            if (sink_) sink_->expect(f, false);
        });
}

/// body(face) for each one around the ends of a candidate, some twice.
template <class Body>
void CollapseLoop::forFaces(uint32_t lane, Body&& body) const {
    for (const uint32_t v : {candidates_.edges.u[lane], candidates_.edges.v[lane]}) {
        const Fan& fan = mesh_.fan[v];
        for (uint32_t j = 0; j < fan.count; ++j) body(mesh_.corner[fan.begin + j] >> 2);
    }
}

void CollapseLoop::collapseCandidates() {
    if (candidates_.count == 0) return;
    place(candidates_.edges, candidates_.count);
    prefetchCandidates();
    for (uint32_t i = 0; i < candidates_.count && wanted(); ++i) {
        const uint32_t v = candidates_.edges.v[i];
        if (sink_ && i + kAhead < candidates_.count)
            forFaces(i + kAhead, [&](uint32_t f) { sink_->expect(f, true); });
        if (!stillThere(candidates_.edges.u[i], v, candidates_.stamp[i])) continue;
        if (collapse(i)) pushEdgesAround(v);
    }
    flushPending();
}

bool CollapseLoop::collapse(uint32_t lane) {
    const EdgeBatch& edges = candidates_.edges;
    const uint32_t u = edges.u[lane], v = edges.v[lane];
    const Vec3f from = mesh_.point[u].vec(), to = mesh_.point[v].vec();
    const Vec3f at{edges.x[lane], edges.y[lane], edges.z[lane]};
    if (!collapser_.allows(u, v, at)) return false;
    // What may be far off is measured last: most edges of the queue never come this far.
    const float deviation = collapser_.deviation(u, v, at);
    const float largest_sq = kLargestShare * deviation * deviation;
    if (largest_sq > limit_sq_) return false;
    const float cost = largest_sq * weightOf(u, v);
    if (CollapseQueue::bucketOf(cost) > current_bucket_) {
        queue_.push(cost, {u, v, candidates_.stamp[lane]});
        return false;
    }
    if (sink_ && !sink_->take({mesh_, u, v, at, deviation, collapser_.ring(), collapser_.wings(),
                               attributes_}))
        return false;
    collapser_.apply(u, v, at);
    std::array<float, kMaxQuadricAttributes> values;
    for (uint32_t j = 0; j < attributes_.view().count; ++j) values[j] = edges.value[j][lane];
    attributes_.merge(mesh_, u, v, from, to, at, values.data());
    mesh_.quadric[v].deviation = deviation;
    if (!positions_.insert(mesh_, v)) fillPositions();
    ++collapses_;
    const float area = mesh_.quadric[v].area;
    if (area > 0) worst_deviation_sq_ = std::max(worst_deviation_sq_, edges.cost[lane] / area);
    return true;
}

}  // namespace pietra
