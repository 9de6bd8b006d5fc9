#include "methods/pmesh/in_core_builder.h"

#include <algorithm>

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

SimplifyOutput collapseAll(const Mesh& mesh, int shift, Recorder& recorder) {
    const std::vector<uint8_t> cell(mesh.triangleCount(), 0);
    const std::vector<uint32_t> quota{0};
    SimplifyInput input;
    input.mesh = &mesh;
    input.cell = cell;
    input.quota = quota;
    input.shift = shift;
    input.sink = &recorder;
    Simplifier simplifier;
    SimplifyOutput output;
    simplifier.run(input, output);
    return output;
}

void takeCollapses(Recorder& recorder, const SimplifyOutput& simplified, Collapses& out) {
    out.vertices = simplified.vertex_map.size();
    out.largest_height = recorder.largestHeight();
    out.dummies = recorder.dummies();
    out.refused = recorder.refused();
    std::vector<uint8_t> gone(out.vertices, 0);
    for (size_t i = 0; i < recorder.records().size(); ++i) {
        const CollapseLink& link = recorder.links()[i];
        if (link.u != kNoVertex) gone[link.u] = 1;
        out.store.append(link, recorder.records()[i]);
    }
    out.base = simplified.mesh;
    out.base_vertex.assign(out.base.vertexCount(), kNoVertex);
    for (uint32_t v = 0; v < out.vertices; ++v)
        if (!gone[v] && simplified.vertex_map[v] != kNone)
            out.base_vertex[simplified.vertex_map[v]] = v;
    for (uint32_t slot = 0; slot < out.base.vertexCount(); ++slot) {
        out.base.normal[slot] = recorder.normalOf(out.base_vertex[slot]);
        out.base_last.push_back(recorder.historyOf(out.base_vertex[slot]).last);
    }
}

}  // namespace

NodeForest buildInCore(Mesh mesh, const Lattice& lattice, Budget& budget, BuildCounts* counts) {
    const Reservation memory =
        budget.reserve(kBuildBytes * mesh.triangleCount(), "a progressive mesh, built in memory,");
    BuildCounts unused;
    BuildCounts& c = counts ? *counts : unused;
    std::vector<uint8_t> irregular;
    {
        HalfEdges edges = findHalfEdges(mesh.triangle, mesh.vertexCount());
        setEdgeClasses(mesh, edges);
        irregular = std::move(edges.irregular);
    }
    c.irregular_vertices = uint64_t(std::count(irregular.begin(), irregular.end(), 1));
    Recorder recorder(mesh, irregular, lattice.shift);
    const SimplifyOutput base = collapseAll(mesh, lattice.shift, recorder);
    TempSpace space{"", &budget, 0};
    Collapses collapses(space);
    takeCollapses(recorder, base, collapses);
    std::vector<OperationNode> nodes;
    NodeForest forest =
        encode(collapses, lattice, space, c, [&](NodeIndex n, const NodeRow&, OperationNode& node) {
            nodes.resize(std::max<size_t>(nodes.size(), n + 1));
            nodes[n] = std::move(node);
        });
    forest.node = std::move(nodes);
    return forest;
}

}  // namespace pietra::pmesh
