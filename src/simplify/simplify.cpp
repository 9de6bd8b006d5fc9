#include "simplify/simplify.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"
#include "simplify/collapse.h"
#include "simplify/collapse_queue.h"
#include "simplify/edge_locks.h"
#include "simplify/fallback.h"
#include "simplify/position_set.h"
#include "simplify/working_mesh.h"

namespace pietra {

// Where collapses are stuck: whole components go from cells this many times above their quota, and
// vertices are clustered in cells this many times above.
static constexpr float kDropAbove = 1.25f, kClusterAbove = 3;

namespace {

/// Border planes count as if the surface went on at a right angle for this many edge lengths.
constexpr float kCurveWeight = 2;

Vec3i centreOf(const Mesh& mesh) {
    if (mesh.position.empty()) return {0, 0, 0};
    Box3i box;
    for (const Vec3i& p : mesh.position) box.add(p);
    const Vec3i middle = box.min + (box.max - box.min) / 2;
    return snapToShift(middle, kMaxLatticeShift);
}

void buildFans(WorkingMesh& mesh) {
    mesh.fan.assign(mesh.point.size(), Fan{0, 0});
    mesh.stamp.assign(mesh.point.size(), 0);
    mesh.mark.assign(mesh.point.size(), 0);
    mesh.epoch = 0;
    for (const Face& face : mesh.face)
        for (const uint32_t v : face.v) ++mesh.fan[v].count;
    uint32_t begin = 0;
    for (Fan& fan : mesh.fan) {
        fan.begin = begin;
        begin += fan.count;
        fan.count = 0;
    }
    mesh.corner_end = begin;
    mesh.corner.resize(std::max(mesh.corner.size(), size_t(begin)));
    for (uint32_t f = 0; f < mesh.face.size(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            Fan& fan = mesh.fan[mesh.face[f].v[k]];
            mesh.corner[fan.begin + fan.count++] = 4 * f + k;
        }
}

/// A plane through each edge on a curve, at a right angle to its triangle.
void addCurvePlanes(WorkingMesh& mesh, const Face& face, const Vec3f& normal) {
    for (uint32_t k = 0; k < 3; ++k) {
        if (face.edgeClass(k) == EdgeClass::kManifold) continue;
        const uint32_t a = face.v[k], b = face.v[kNextCorner[k]];
        const Vec3f edge = mesh.point[b].vec() - mesh.point[a].vec();
        const Vec3f across = glm::cross(edge, normal);
        const float length_sq = glm::dot(across, across);
        if (!(length_sq > 0)) continue;
        const Vec3f unit = across / std::sqrt(length_sq);
        Quadric q = Quadric::ofPlane(unit, kCurveWeight * length_sq);
        q.area = 0;
        mesh.quadric[a].addMatrix(q);
        mesh.quadric[b].addMatrix(q);
    }
}

/// A plane counts by its triangle's area and this many mean areas: by area alone, spikes and slivers
/// weigh nothing and are cut off, and the largest distance is what a diamond states.
/// (3: the dragon's stated errors by level fall by 30 to 40 %, the Moon's by 5 to 25 %.)
constexpr double kEqualShare = 3;

float areaOf(const WorkingMesh& mesh, const Face& face) {
    const Vec3f a = mesh.point[face.v[0]].vec();
    const Vec3f n = glm::cross(mesh.point[face.v[1]].vec() - a, mesh.point[face.v[2]].vec() - a);
    return std::sqrt(glm::dot(n, n));
}

void buildQuadrics(WorkingMesh& mesh) {
    double total = 0;
    for (const Face& face : mesh.face) total += double(areaOf(mesh, face));
    const float share =
        float(kEqualShare * total / double(std::max<size_t>(mesh.face.size(), 1)));
    mesh.quadric.assign(mesh.point.size(), Quadric{});
    for (const Face& face : mesh.face) {
        const Vec3f a = mesh.point[face.v[0]].vec();
        const Vec3f cross =
            glm::cross(mesh.point[face.v[1]].vec() - a, mesh.point[face.v[2]].vec() - a);
        const float area = areaOf(mesh, face);
        if (!(area > 0)) continue;
        const Vec3f normal = cross / area;
        const Quadric q = Quadric::ofPlane(normal, area + share);
        for (const uint32_t v : face.v) mesh.quadric[v].addMatrix(q);
        if (face.classes() != 0) addCurvePlanes(mesh, face, normal);
    }
}

OctNormal mixNormals(const OctNormal& a, const OctNormal& b, float t) {
    const Vec3f n = decodeNormal(a) * (1 - t) + decodeNormal(b) * t;
    return glm::dot(n, n) > 1e-12f ? encodeNormal(n) : t < 0.5f ? a : b;
}

uint8_t mixBytes(uint8_t a, uint8_t b, float t) {
    return uint8_t(float(a) + (float(b) - float(a)) * t + 0.5f);
}

}  // namespace

/// Edges taken from the queue to be collapsed.
struct Candidates {
    EdgeBatch edges;
    std::array<uint32_t, kBatch> stamp;
    uint32_t count = 0;
};

struct Simplifier::State {
    WorkingMesh mesh;
    PositionSet positions;
    CollapseQueue queue;
    Collapser collapser{mesh, positions};
    Fallback fallback;
    SnapGrid grid;
    std::vector<OctNormal> normal;
    std::vector<Rgba8> colour;
    std::vector<float> scalar;
    int scalar_count = 0;
    std::vector<uint32_t> new_vertex;

    void load(const SimplifyInput& input);
    void buildPositions();
    EdgeKernels kernels = chooseEdgeKernels();
    EdgeBatch pending;  // edges to be evaluated and pushed
    uint32_t pending_count = 0;

    void pushEdge(uint32_t u, uint32_t v);
    void flushPending();
    void pushAllEdges();
    void pushEdgesAround(uint32_t v);
    bool stillThere(uint32_t u, uint32_t v, uint32_t stamp) const {
        return mesh.stamp[u] + mesh.stamp[v] == stamp;
    }
    void popCandidates(Candidates& batch);
    void prefetchCandidates(const Candidates& batch);
    void collapseCandidates(Candidates& batch);
    void drainQueue();
    Candidates candidates;
    uint32_t collapses = 0;
    float worst_deviation_sq = 0;
    void mixAttributes(uint32_t removed, uint32_t kept, const Vec3f& from, const Vec3f& to,
                       const Vec3f& at);
    void fallBack(float droppable_error, SimplifyOutput& output);
    void store(const SimplifyInput& input, SimplifyOutput& output);
    void storeVertices(const Mesh& in, SimplifyOutput& out);
    void storeTriangles(const Mesh& in, SimplifyOutput& out);
};

void Simplifier::State::load(const SimplifyInput& input) {
    const Mesh& in = *input.mesh;
    CHECK_EQ(input.cell.size(), in.triangleCount());
    CHECK_LE(input.quota.size(), size_t(256));
    CHECK_EQ(in.edge_class.size(), in.triangleCount());
    CHECK_EQ(in.normal.size(), in.vertexCount());
    CHECK_EQ(in.scalar.size(), in.vertexCount() * size_t(input.scalar_count));
    mesh.centre = centreOf(in);
    mesh.point.resize(in.vertexCount());
    for (size_t v = 0; v < in.vertexCount(); ++v) {
        const Vec3i p = in.position[v] - mesh.centre;
        mesh.point[v] = {float(p.x), float(p.y), float(p.z), 0};
    }
    mesh.face.resize(in.triangleCount());
    mesh.cell_count.fill(0);
    mesh.cell_quota.fill(0);
    for (size_t c = 0; c < input.quota.size(); ++c)
        mesh.cell_quota[c] = std::min(input.quota[c], uint32_t(in.triangleCount()));
    for (size_t t = 0; t < in.triangleCount(); ++t) {
        const Triangle& c = in.triangle[t];
        mesh.face[t] = {{c[0], c[1], c[2]}, uint32_t(input.cell[t]) | in.edge_class[t] << 8};
        ++mesh.cell_count[input.cell[t]];
    }
    mesh.cells_above = 0;
    for (uint32_t c = 0; c < 256; ++c) mesh.cells_above += mesh.cellAbove(c);
    mesh.parent.resize(in.vertexCount());
    for (uint32_t v = 0; v < mesh.parent.size(); ++v) mesh.parent[v] = v;
    normal = in.normal;
    colour = in.colour;
    scalar = in.scalar;
    scalar_count = input.scalar_count;
    grid.step = float(1 << input.shift);
    grid.inverse_step = 1 / grid.step;
    grid.low = Vec3f(-mesh.centre);
    grid.high = Vec3f(Vec3i(kLatticeMax) - mesh.centre);
    queue.clear();
    worst_deviation_sq = 0;
    collapses = 0;
}

void Simplifier::State::buildPositions() {
    positions.reset(2 * mesh.point.size());
    for (uint32_t v = 0; v < mesh.point.size(); ++v)
        if (!mesh.point[v].dead()) positions.insert(mesh, v);
}

void Simplifier::State::pushEdge(uint32_t u, uint32_t v) {
    pending.u[pending_count] = u;
    pending.v[pending_count] = v;
    __builtin_prefetch(&mesh.quadric[v]);
    if (++pending_count == kBatch) flushPending();
}

void Simplifier::State::flushPending() {
    if (pending_count == 0) return;
    for (uint32_t i = pending_count; i < kBatch; ++i) {
        pending.u[i] = pending.u[0];
        pending.v[i] = pending.v[0];
    }
    kernels.place(mesh.point.data(), mesh.quadric.data(), grid, pending);
    for (uint32_t i = 0; i < pending_count; ++i) {
        const uint32_t u = pending.u[i], v = pending.v[i];
        const uint32_t stamp = mesh.stamp[u] + mesh.stamp[v];
        if (stamp < WorkingMesh::kDeadStamp) queue.push(pending.cost[i], {u, v, stamp});
    }
    pending_count = 0;
}

/// Each edge once where triangles are plain; irregular ones maybe twice, which does no harm.
void Simplifier::State::pushAllEdges() {
    for (const Face& face : mesh.face) {
        if (face.dead()) continue;
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t u = face.v[k], v = face.v[kNextCorner[k]];
            const uint32_t shared_flags = mesh.point[u].flags & mesh.point[v].flags;
            if (u > v && !(shared_flags & kIrregularFlag)) continue;
            if (collapsibleEdge(mesh, face, k)) pushEdge(u, v);
        }
    }
    flushPending();
}

/// The edges of `v`, whose ring the collapser has just read.
void Simplifier::State::pushEdgesAround(uint32_t v) {
    const Ring& ring = collapser.ring();
    const uint32_t epoch = mesh.epoch += 2;
    const auto visit = [&](uint32_t w, const Face& face, uint32_t edge) {
        if (mesh.mark[w] == epoch) return;
        mesh.mark[w] = epoch;
        if (collapsibleEdge(mesh, face, edge)) pushEdge(v, w);
    };
    for (uint32_t i = 0; i < ring.size; ++i) {
        const Face& face = mesh.face[ring.corner[i] >> 2];
        const uint32_t k = ring.corner[i] & 3;
        visit(ring.next[i], face, k);
        visit(ring.previous[i], face, kPreviousCorner[k]);
    }
}

void Simplifier::State::mixAttributes(uint32_t removed, uint32_t kept, const Vec3f& from,
                                      const Vec3f& to, const Vec3f& at) {
    const Vec3f edge = to - from;
    const float t = std::clamp(glm::dot(at - from, edge) / glm::dot(edge, edge), 0.0f, 1.0f);
    normal[kept] = mixNormals(normal[removed], normal[kept], t);
    if (!colour.empty()) {
        const Rgba8 a = colour[removed], b = colour[kept];
        colour[kept] = {mixBytes(a.r, b.r, t), mixBytes(a.g, b.g, t), mixBytes(a.b, b.b, t),
                        mixBytes(a.a, b.a, t)};
    }
    for (int i = 0; i < scalar_count; ++i) {
        const float a = scalar[size_t(removed) * scalar_count + i];
        float& b = scalar[size_t(kept) * scalar_count + i];
        b = std::isfinite(a) && std::isfinite(b) ? a + (b - a) * t : t < 0.5f ? a : b;
    }
}

/// Edges of the lowest bucket as they are now, up to sixteen; fewer, or none, where it has no more.
void Simplifier::State::popCandidates(Candidates& batch) {
    batch.count = 0;
    const uint32_t bucket = queue.lowestBucket();
    if (bucket == CollapseQueue::kNoBucket) return;
    while (batch.count < kBatch && !queue.empty(bucket)) {
        const CollapseQueue::Entry e = queue.pop(bucket);
        if (!stillThere(e.u, e.v, e.stamp)) continue;
        const bool swap = mesh.point[e.u].rank() > mesh.point[e.v].rank();
        batch.edges.u[batch.count] = swap ? e.v : e.u;
        batch.edges.v[batch.count] = swap ? e.u : e.v;
        batch.stamp[batch.count++] = e.stamp;
        __builtin_prefetch(&mesh.fan[e.u]);
        __builtin_prefetch(&mesh.fan[e.v]);
        __builtin_prefetch(&mesh.quadric[e.u]);
        __builtin_prefetch(&mesh.quadric[e.v]);
    }
}

void Simplifier::State::prefetchCandidates(const Candidates& batch) {
    const EdgeBatch& edges = batch.edges;
    for (uint32_t i = 0; i < batch.count; ++i) {
        __builtin_prefetch(&mesh.corner[mesh.fan[edges.u[i]].begin]);
        __builtin_prefetch(&mesh.corner[mesh.fan[edges.v[i]].begin]);
        __builtin_prefetch(&normal[edges.u[i]]);
        __builtin_prefetch(&normal[edges.v[i]]);
        positions.prefetch({edges.x[i], edges.y[i], edges.z[i]});
    }
    for (uint32_t i = 0; i < batch.count; ++i)
        for (const uint32_t v : {edges.u[i], edges.v[i]}) {
            const Fan& fan = mesh.fan[v];
            for (uint32_t j = 0; j < fan.count; ++j)
                __builtin_prefetch(&mesh.face[mesh.corner[fan.begin + j] >> 2]);
        }
}

void Simplifier::State::collapseCandidates(Candidates& batch) {
    EdgeBatch& edges = batch.edges;
    for (uint32_t i = batch.count; i < kBatch; ++i) {
        edges.u[i] = edges.u[0];
        edges.v[i] = edges.v[0];
    }
    kernels.place(mesh.point.data(), mesh.quadric.data(), grid, edges);
    prefetchCandidates(batch);
    for (uint32_t i = 0; i < batch.count && mesh.cells_above > 0; ++i) {
        const uint32_t u = edges.u[i], v = edges.v[i];
        if (!stillThere(u, v, batch.stamp[i])) continue;
        const Vec3f from = mesh.point[u].vec(), to = mesh.point[v].vec();
        const Vec3f at{edges.x[i], edges.y[i], edges.z[i]};
        if (!collapser.tryCollapse(u, v, at)) continue;
        ++collapses;
        if (!positions.insert(mesh, v)) buildPositions();
        const float area = mesh.quadric[v].area;
        if (area > 0) worst_deviation_sq = std::max(worst_deviation_sq, edges.cost[i] / area);
        mixAttributes(u, v, from, to, at);
        pushEdgesAround(v);
    }
    flushPending();
}

void Simplifier::State::drainQueue() {
    while (mesh.cells_above > 0 && queue.lowestBucket() != CollapseQueue::kNoBucket) {
        popCandidates(candidates);
        if (candidates.count > 0) collapseCandidates(candidates);
    }
}

void Simplifier::State::fallBack(float droppable_error, SimplifyOutput& output) {
    fallback.allowForLocks(mesh);
    if (mesh.cells_above == 0) return;
    const float droppable = std::max(droppable_error, output.estimated_error);
    output.dropped_triangles = fallback.dropComponents(mesh, droppable);
    if (mesh.cells_above == 0) return;
    // Topology holds on to what is left. A little more than asked for is better than harm.
    fallback.relaxQuotas(mesh, kDropAbove);
    output.dropped_triangles += fallback.dropComponents(mesh, HUGE_VALF);
    if (mesh.cells_above == 0) return;
    fallback.relaxQuotas(mesh, kClusterAbove / kDropAbove);
    if (mesh.cells_above == 0) return;
    float spacing = droppable;
    output.clustered = fallback.clusterVertices(mesh, spacing);
    output.estimated_error = std::max(output.estimated_error, spacing);
}

void Simplifier::State::store(const SimplifyInput& input, SimplifyOutput& out) {
    storeVertices(*input.mesh, out);
    storeTriangles(*input.mesh, out);
}

void Simplifier::State::storeVertices(const Mesh& in, SimplifyOutput& out) {
    const size_t count = in.vertexCount();
    new_vertex.assign(count, kNone);
    for (const Face& face : mesh.face)
        if (!face.dead())
            for (const uint32_t v : face.v) new_vertex[v] = 0;
    uint32_t next = 0;
    for (uint32_t& index : new_vertex)
        if (index != kNone) index = next++;
    out.mesh.position.resize(next);
    out.mesh.normal.resize(next);
    out.mesh.colour.resize(colour.empty() ? 0 : next);
    out.mesh.scalar.resize(size_t(next) * scalar_count);
    out.vertex_map.resize(count);
    for (uint32_t v = 0; v < count; ++v) {
        const uint32_t to = new_vertex[mesh.root(v)];
        out.vertex_map[v] = to;
        if (to == kNone || mesh.parent[v] != v) continue;
        out.mesh.position[to] = mesh.latticePosition(v);
        out.mesh.normal[to] = normal[v];
        if (!colour.empty()) out.mesh.colour[to] = colour[v];
        for (int i = 0; i < scalar_count; ++i)
            out.mesh.scalar[size_t(to) * scalar_count + i] = scalar[size_t(v) * scalar_count + i];
    }
}

void Simplifier::State::storeTriangles(const Mesh& in, SimplifyOutput& out) {
    uint32_t alive = 0;
    for (const Face& face : mesh.face) alive += !face.dead();
    out.mesh.triangle.resize(alive);
    out.mesh.edge_class.resize(alive);
    out.cell.resize(alive);
    out.triangle_changed.resize(alive);
    out.triangle_map.resize(mesh.face.size());
    uint32_t next = 0;
    for (uint32_t f = 0; f < mesh.face.size(); ++f) {
        const Face& face = mesh.face[f];
        out.triangle_map[f] = face.dead() ? kNone : next;
        if (face.dead()) continue;
        Triangle& t = out.mesh.triangle[next];
        bool changed = false;
        for (uint32_t k = 0; k < 3; ++k) {
            t[k] = new_vertex[face.v[k]];
            changed |= out.mesh.position[t[k]] != in.position[in.triangle[f][k]];
        }
        out.mesh.edge_class[next] = uint8_t(face.classes());
        out.cell[next] = uint8_t(face.cell());
        out.triangle_changed[next] = changed;
        ++next;
    }
}

Simplifier::Simplifier() : state_(std::make_unique<State>()) {}
Simplifier::~Simplifier() = default;
Simplifier::Simplifier(Simplifier&&) noexcept = default;
Simplifier& Simplifier::operator=(Simplifier&&) noexcept = default;

void Simplifier::run(const SimplifyInput& input, SimplifyOutput& output) {
    State& s = *state_;
    s.load(input);
    buildFans(s.mesh);
    output.locked_vertices = classifyVertices(s.mesh);
    buildQuadrics(s.mesh);
    s.buildPositions();
    output.clustered = output.dropped_triangles = 0;
    while (s.mesh.cells_above > 0) {
        s.pushAllEdges();
        const uint32_t before = s.collapses;
        s.drainQueue();
        if (s.collapses == before) break;
    }
    output.collapses = s.collapses;
    output.estimated_error = std::sqrt(s.worst_deviation_sq);
    if (s.mesh.cells_above > 0) s.fallBack(input.droppable_error, output);
    s.store(input, output);
}

}  // namespace pietra
