#include "methods/pmesh/twins.h"

#include <algorithm>

namespace pietra::pmesh {
namespace {

struct EdgeUse {
    uint64_t ends;  // the lower one in the upper half
    uint32_t corner;
    bool forward;
    bool operator<(const EdgeUse& o) const {
        return ends != o.ends ? ends < o.ends : corner < o.corner;
    }
};

std::vector<EdgeUse> sortedUses(std::span<const Triangle> triangles) {
    std::vector<EdgeUse> uses;
    uses.reserve(3 * triangles.size());
    for (uint32_t f = 0; f < triangles.size(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t a = triangles[f][k], b = triangles[f][(k + 1) % 3];
            uses.push_back({uint64_t(std::min(a, b)) << 32 | std::max(a, b), 4 * f + k, a < b});
        }
    std::sort(uses.begin(), uses.end());
    return uses;
}

void linkTwins(std::span<const Triangle> triangles, HalfEdges& edges) {
    const std::vector<EdgeUse> uses = sortedUses(triangles);
    edges.twin.assign(uses.size(), kNoCorner);
    edges.uses.resize(uses.size());
    for (size_t i = 0, end; i < uses.size(); i = end) {
        for (end = i + 1; end < uses.size() && uses[end].ends == uses[i].ends;) ++end;
        const bool twins = end - i == 2 && uses[i].forward != uses[i + 1].forward;
        for (size_t j = i; j < end; ++j) {
            const uint32_t slot = slotOf(uses[j].corner);
            edges.uses[slot] = uint8_t(std::min<size_t>(end - i, 255));
            if (twins) edges.twin[slot] = uses[i + i + 1 - j].corner;
            if (twins || end - i == 1) continue;
            edges.irregular[uint32_t(uses[j].ends)] = 1;
            edges.irregular[uint32_t(uses[j].ends >> 32)] = 1;
        }
    }
}

}  // namespace

HalfEdges findHalfEdges(std::span<const Triangle> triangles, size_t vertices) {
    HalfEdges edges;
    edges.irregular.assign(vertices, 0);
    edges.corner_of.assign(vertices, kNoCorner);
    linkTwins(triangles, edges);
    std::vector<uint32_t> corners(vertices, 0);
    for (uint32_t f = 0; f < triangles.size(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            const uint32_t v = triangles[f][k];
            ++corners[v];
            if (edges.corner_of[v] == kNoCorner || edges.twin[3 * f + k] == kNoCorner)
                edges.corner_of[v] = 4 * f + k;
        }
    for (uint32_t v = 0; v < vertices; ++v) {
        const uint32_t first = edges.corner_of[v];
        for (uint32_t c = first; c != kNoCorner;) {
            --corners[v];
            c = edges.twin[slotOf(previousCorner(c))];
            if (c == first) break;
        }
        edges.irregular[v] |= corners[v] != 0;
    }
    return edges;
}

}  // namespace pietra::pmesh
