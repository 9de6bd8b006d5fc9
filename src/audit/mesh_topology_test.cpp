#include "audit/mesh_topology.h"

#include <gtest/gtest.h>

namespace pietra {
namespace {

Mesh meshOf(uint32_t vertices, std::vector<Triangle> triangles) {
    Mesh mesh;
    mesh.position.resize(vertices);
    mesh.triangle = std::move(triangles);
    return mesh;
}

TEST(MeshTopology, TellsClosedFromOpenAndTorn) {
    const std::vector<Triangle> tetrahedron = {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 0}};
    EXPECT_EQ(topologyOf(meshOf(5, tetrahedron)), (MeshTopology{2, 0, 0, 0}));
    // A crack: one corner of one triangle has a vertex of its own.
    EXPECT_EQ(topologyOf(meshOf(5, {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}, {2, 3, 4}})),
              (MeshTopology{1, 1, 0, 0}));
    EXPECT_EQ(topologyOf(meshOf(5, {{0, 1, 2}, {0, 3, 1}, {1, 3, 2}})), (MeshTopology{1, 1, 0, 0}));
    EXPECT_EQ(topologyOf(meshOf(6, {{0, 1, 2}, {3, 4, 5}})), (MeshTopology{2, 2, 0, 0}));
    EXPECT_EQ(topologyOf(meshOf(4, {{0, 1, 2}, {0, 1, 3}})).irregular_edges, 1u);
    EXPECT_EQ(topologyOf(meshOf(3, {{0, 1, 2}, {0, 1, 1}})).degenerate, 1u);
}

}  // namespace
}  // namespace pietra
