#include "methods/pmesh/in_core_builder.h"

#include <algorithm>
#include <numeric>

#include "methods/pmesh/split_encoder.h"
#include "methods/pmesh/twins.h"
#include "simplify/simplify.h"

namespace pietra::pmesh {
namespace {

/// Non-manifold edges and those of triangles that disagree on their orientation are of class kMany:
/// the simplifier locks their ends.
void setEdgeClasses(Mesh& mesh, const HalfEdges& edges) {
    mesh.edge_class.assign(mesh.triangleCount(), 0);
    for (uint32_t slot = 0; slot < edges.twin.size(); ++slot) {
        const EdgeClass c = edges.twin[slot] != kNoCorner ? EdgeClass::kManifold
                            : edges.uses[slot] == 1       ? EdgeClass::kBorder
                                                          : EdgeClass::kMany;
        mesh.edge_class[slot / 3] |= uint8_t(uint32_t(c) << (2 * (slot % 3)));
    }
}

/// Sets edge classes; the irregular vertices.
std::vector<uint8_t> prepare(Mesh& mesh) {
    HalfEdges edges = findHalfEdges(mesh.triangle, mesh.vertexCount());
    setEdgeClasses(mesh, edges);
    return std::move(edges.irregular);
}

SimplifyOutput collapseAll(const Mesh& mesh, int shift, CollapseSink& sink) {
    const std::vector<uint8_t> cell(mesh.triangleCount(), 0);
    const std::vector<uint32_t> quota{0};
    SimplifyInput input;
    input.mesh = &mesh;
    input.cell = cell;
    input.quota = quota;
    input.shift = shift;
    input.scalar_count = int(WordLayout::of(mesh).scalars);
    input.sink = &sink;
    Simplifier simplifier;
    SimplifyOutput output;
    simplifier.run(input, output);
    return output;
}

void takeCollapses(Recorder& recorder, const SimplifyOutput& simplified, Collapses& out) {
    out.largest_height = recorder.largestHeight();
    out.refused = recorder.refused();
    std::vector<uint32_t> number(simplified.vertex_map.size());
    std::iota(number.begin(), number.end(), 0u);
    out.numbers = uint32_t(number.size());
    std::vector<uint8_t> gone(number.size(), 0);
    for (const CollapseLink& link : recorder.links()) gone[link.u] = 1;
    out.store.append(recorder.links(), recorder.records(), number, recorder.words());
    out.base = simplified.mesh;
    out.base_leaves.resize(out.base.triangleCount());
    out.base_closed.assign(out.base.triangleCount(), 1);
    for (uint32_t f = 0; f < simplified.triangle_map.size(); ++f)
        if (const uint32_t t = simplified.triangle_map[f]; t != kNone)
            out.base_leaves[t] = recorder.leavesOf(f);
    out.base_vertex.resize(out.base.vertexCount());
    for (uint32_t v = 0; v < number.size(); ++v)
        if (!gone[v] && simplified.vertex_map[v] != kNone)
            out.base_vertex[simplified.vertex_map[v]] = v;
    for (uint32_t slot = 0; slot < out.base.vertexCount(); ++slot) {
        const auto v = uint32_t(out.base_vertex[slot]);
        out.base.normal[slot] = recorder.normalOf(v);
        out.base_last.push_back(recorder.historyOf(v).last);
    }
}

}  // namespace

SplitForest buildInCore(Mesh mesh, const Lattice& lattice, Budget& budget, BuildCounts* counts) {
    const Reservation memory =
        budget.reserve(kBuildBytes * mesh.triangleCount(), "a progressive mesh, built in memory,");
    BuildCounts unused;
    BuildCounts& c = counts ? *counts : unused;
    const std::vector<uint8_t> irregular = prepare(mesh);
    c.irregular_vertices = uint64_t(std::count(irregular.begin(), irregular.end(), 1));
    Recorder recorder(mesh, irregular, lattice.shift);
    const SimplifyOutput base = collapseAll(mesh, lattice.shift, recorder);
    TempSpace space{"", &budget, 0};
    Collapses collapses(space);
    takeCollapses(recorder, base, collapses);
    return encodeInMemory(collapses, lattice, space, c);
}

SplitForest encodeInMemory(const Collapses& collapses, const Lattice& lattice, TempSpace& space,
                           BuildCounts& counts) {
    std::vector<SplitNode> nodes;
    std::vector<SplitRow> rows;
    SplitForest forest =
        encodeSplits(collapses, lattice, space, counts,
                     [&](NodeIndex n, const SplitRow& row, const SplitGrid&, SplitNode& node) {
                         nodes.resize(std::max<size_t>(nodes.size(), n + 1));
                         rows.resize(nodes.size());
                         nodes[n] = std::move(node);
                         rows[n] = row;
                     });
    forest.node = std::move(nodes);
    forest.row = std::move(rows);
    return forest;
}

void collapseInCore(Mesh mesh, const Lattice& lattice, Budget& budget,
                    const std::function<std::unique_ptr<CollapseSink>(Recorder& recorder)>& sink) {
    const Reservation memory =
        budget.reserve(kBuildBytes * mesh.triangleCount(), "a simplification in memory");
    const std::vector<uint8_t> irregular = prepare(mesh);
    Recorder recorder(mesh, irregular, lattice.shift);
    collapseAll(mesh, lattice.shift, *sink(recorder));
}

}  // namespace pietra::pmesh
