#pragma once
// An exact count of cracks for tests, on the lattice, by other means than the code under test: how
// often each edge is used, and whether the border is the input's.

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "geometry/lattice.h"
#include "geometry/mesh.h"

namespace pietra::cluster {

using EdgeKey = std::pair<uint64_t, uint64_t>;

struct EdgeUses {
    int uses = 0, upward = 0;  // upward: from the smaller key to the larger
    std::set<EdgeClass> classes;
};

inline std::map<EdgeKey, EdgeUses> edgeUsesOf(const Mesh& mesh) {
    std::map<EdgeKey, EdgeUses> edges;
    for (size_t t = 0; t < mesh.triangleCount(); ++t)
        for (int k = 0; k < 3; ++k) {
            const uint64_t a = latticeKey(mesh.position[mesh.triangle[t][k]]);
            const uint64_t b = latticeKey(mesh.position[mesh.triangle[t][(k + 1) % 3]]);
            EdgeUses& edge = edges[{std::min(a, b), std::max(a, b)}];
            ++edge.uses;
            edge.upward += a < b;
            edge.classes.insert(mesh.edgeClass(t, k));
        }
    return edges;
}

struct CrackCount {
    size_t edges = 0, cracked = 0, overlapping = 0, disagreeing = 0, turned = 0, stray_border = 0;
    bool ok() const { return cracked + overlapping + disagreeing + turned + stray_border == 0; }
    std::string text() const {
        return fmt::format(
            "{} edges: {} cracked, {} overlapping, {} disagreeing, {} turned, {} stray", edges,
            cracked, overlapping, disagreeing, turned, stray_border);
    }
};

/// The border's neighbours of each of its vertices.
inline std::map<uint64_t, std::vector<uint64_t>> borderOf(
    const std::map<EdgeKey, EdgeUses>& edges) {
    std::map<uint64_t, std::vector<uint64_t>> border;
    for (const auto& [key, edge] : edges)
        if (edge.uses == 1) {
            border[key.first].push_back(key.second);
            border[key.second].push_back(key.first);
        }
    return border;
}

/// How many edges of one border do not stand for a way along the other, past vertices that the
/// first has not; and how many of the other's no edge stands for.
inline size_t strayBorder(const std::map<EdgeKey, EdgeUses>& mixed,
                          const std::map<EdgeKey, EdgeUses>& model) {
    const auto coarse = borderOf(mixed), fine = borderOf(model);
    std::map<EdgeKey, int> ways;
    size_t fine_edges = 0, covered = 0;
    for (const auto& [from, starts] : fine) {
        fine_edges += starts.size();
        if (!coarse.contains(from)) continue;
        for (uint64_t at : starts) {
            uint64_t before = from;
            size_t length = 1;
            while (!coarse.contains(at) && fine.at(at).size() == 2 && length <= model.size()) {
                const auto& both = fine.at(at);
                const uint64_t after = both[0] == before ? both[1] : both[0];
                before = at;
                at = after;
                ++length;
            }
            covered += length;
            ++ways[{std::min(from, at), std::max(from, at)}];
        }
    }
    size_t stray = fine_edges - covered;
    for (const auto& [from, ends] : coarse)
        for (const uint64_t to : ends) stray += from < to && ways[{from, to}] != 2;
    return stray;
}

/// `orientable`: no edge of class manifold is used twice in one direction.
inline CrackCount countCracks(const Mesh& mixed, const Mesh& model, bool orientable) {
    const auto edges = edgeUsesOf(mixed);
    CrackCount count;
    count.edges = edges.size();
    for (const auto& [key, edge] : edges) {
        const EdgeClass c = *edge.classes.begin();
        const int wanted = c == EdgeClass::kBorder     ? 1
                           : c == EdgeClass::kManifold ? 2
                           : c == EdgeClass::kTriple   ? 3
                                                       : std::max(4, edge.uses);
        count.disagreeing += edge.classes.size() > 1 || key.first == key.second;
        count.cracked += edge.uses < wanted;
        count.overlapping += edge.uses > wanted;
        count.turned += orientable && c == EdgeClass::kManifold && 2 * edge.upward != edge.uses;
    }
    count.stray_border = strayBorder(edges, edgeUsesOf(model));
    return count;
}

}  // namespace pietra::cluster
