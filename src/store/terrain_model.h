#pragma once
// The toy terrain (multires/toy_terrain.h) as a model file, for tests of what reads models.

#include <algorithm>
#include <string>
#include <vector>

#include "multires/toy_terrain.h"
#include "store/model_writer.h"
#include "store/page_codec.h"

namespace pietra {

namespace terrain_model {

inline void writeLevel(const ToyTerrain& terrain, uint32_t level,
                       const std::vector<NodeIndex>& nodes, const std::vector<NodeIndex>& place,
                       ModelWriter& writer) {
    constexpr size_t kNodesOfPage = 5;
    writer.beginLevel(level);
    for (size_t first = 0; first < nodes.size(); first += kNodesOfPage) {
        std::vector<Node> page;
        std::vector<Mesh> meshes;
        std::vector<const Mesh*> pointers;
        for (size_t k = first; k < std::min(nodes.size(), first + kNodesOfPage); ++k) {
            page.push_back(terrain.nodes[nodes[k]]);
            for (NodeIndex& child : page.back().child)
                if (child != kNoNode) child = place[child];
            meshes.push_back(terrain.patches[nodes[k]]);
            meshes.back().normal.resize(meshes.back().vertexCount());
        }
        for (const Mesh& mesh : meshes) pointers.push_back(&mesh);
        writer.addPage(encodePage(pointers, {}), page);
    }
}

}  // namespace terrain_model

/// Writes the terrain to `path`, several patches a page. Nodes are numbered by level.
inline void writeTerrainModel(const ToyTerrain& terrain, const std::string& path,
                              const std::string& temp_dir, const Vec3d& origin = {0, 0, 0}) {
    Budget budget(size_t(64) << 20);
    ModelWriter writer(path, true, temp_dir, budget);
    std::vector<std::vector<NodeIndex>> levels;
    std::vector<NodeIndex> place(terrain.nodes.size(), kNoNode);  // within its level
    for (NodeIndex i = 0; i < terrain.nodes.size(); ++i) {
        levels.resize(std::max<size_t>(levels.size(), terrain.nodes[i].level + 1u));
        place[i] = NodeIndex(levels[terrain.nodes[i].level].size());
        levels[terrain.nodes[i].level].push_back(i);
    }
    for (size_t level = levels.size(); level-- > 0;)
        terrain_model::writeLevel(terrain, uint32_t(level), levels[level], place, writer);
    ModelInfo info;
    info.method = "toy";
    info.face_sizes = true;
    info.lattice = {origin, 0.01, 0};
    info.quantisation_error = ToyTerrainSettings{}.quantisation_error;
    for (const Mesh& mesh : terrain.patches)
        for (const Vec3i& p : mesh.position) info.bounds.add(p);
    for (const Node& node : terrain.nodes)
        if (node.isLeaf()) info.input_triangles += node.triangles;
    writer.finish(info);
}

}  // namespace pietra
