#include "simplify/simplify.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "geometry/lattice.h"
#include "simplify/attributes.h"
#include "simplify/collapse_loop.h"
#include "simplify/edge_locks.h"
#include "simplify/fallback.h"
#include "simplify/initial_quadrics.h"
#include "simplify/working_mesh.h"

namespace pietra {
namespace {

// Where collapses are stuck: whole components go from cells this many times above their quota, and
// vertices are clustered in cells this many times above.
constexpr float kDropAbove = 1.25f, kClusterAbove = 3;

float extentOf(const WorkingMesh& mesh) {
    Vec3f high(0);  // of the absolute coordinates: the centre is that of the box, roughly
    for (const Point& p : mesh.point) high = glm::max(high, glm::abs(p.vec()));
    return 2 * std::max(high.x, std::max(high.y, high.z));
}

SnapGrid gridOf(const WorkingMesh& mesh, int shift) {
    SnapGrid grid;
    grid.step = float(1 << shift);
    grid.inverse_step = 1 / grid.step;
    grid.low = Vec3f(-mesh.centre);
    grid.high = Vec3f(Vec3i(kLatticeMax) - mesh.centre);
    return grid;
}

}  // namespace

struct Simplifier::State {
    WorkingMesh mesh;
    VertexClassifier classifier;
    VertexAttributes attributes;
    CollapseLoop loop{mesh, attributes};
    Fallback fallback;
    std::vector<uint32_t> new_vertex;

    void fallBack(float free_error, SimplifyOutput& output);
    void storeVertices(const Mesh& in, SimplifyOutput& out);
    void storeTriangles(const Mesh& in, SimplifyOutput& out);
};

void Simplifier::State::fallBack(float free_error, SimplifyOutput& output) {
    fallback.allowForLocks(mesh);
    if (mesh.cells_above == 0) return;
    const float droppable = std::max(free_error, output.estimated_error);
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
    attributes.resizeOutput(out.mesh, next);
    out.vertex_map.resize(count);
    for (uint32_t v = 0; v < count; ++v) {
        const uint32_t to = new_vertex[mesh.root(v)];
        out.vertex_map[v] = to;
        if (to == kNone || mesh.parent[v] != v) continue;
        out.mesh.position[to] = mesh.latticePosition(v);
        attributes.store(v, out.mesh, to);
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
    const Mesh& in = *input.mesh;
    CHECK_EQ(in.normal.size(), in.vertexCount());
    CHECK_EQ(in.scalar.size(), in.vertexCount() * size_t(input.scalar_count));
    State& s = *state_;
    s.mesh.load(in, input.cell, input.quota);
    s.attributes.load(in, uint32_t(input.scalar_count), input.scalar_range, extentOf(s.mesh));
    output.locked_vertices = s.classifier.run(s.mesh);
    buildQuadrics(s.mesh, s.attributes);
    s.loop.run(gridOf(s.mesh, input.shift), input.free_error, input.sink);
    output.collapses = s.loop.collapses();
    output.estimated_error = s.loop.worstDeviation();
    output.clustered = output.dropped_triangles = 0;
    if (s.mesh.cells_above > 0 && !input.sink) s.fallBack(input.free_error, output);
    s.storeVertices(in, output);
    s.storeTriangles(in, output);
}

}  // namespace pietra
