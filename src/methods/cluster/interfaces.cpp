#include "methods/cluster/interfaces.h"

#include <algorithm>
#include <map>

#include "base/check.h"
#include "base/disjoint_sets.h"

namespace pietra::cluster {

namespace {

uint64_t pairKey(uint32_t a, uint32_t b) {
    return uint64_t(std::min(a, b)) << 32 | std::max(a, b);
}

/// A triangle's use of an edge.
struct EdgeUse {
    uint64_t pair;
    uint32_t corner;  // 3 * triangle + k; the edge goes to the next one
    bool operator<(const EdgeUse& o) const {
        return pair < o.pair || (pair == o.pair && corner < o.corner);
    }
};

uint32_t beginOf(const Mesh& mesh, uint32_t corner) {
    return mesh.triangle[corner / 3][corner % 3];
}
uint32_t endOf(const Mesh& mesh, uint32_t corner) {
    return mesh.triangle[corner / 3][(corner % 3 + 1) % 3];
}

/// visit(uses): once an edge.
template <class Visit>
void forEachEdge(const Mesh& mesh, Visit&& visit) {
    std::vector<EdgeUse> uses;
    for (uint32_t c = 0; c < 3 * mesh.triangleCount(); ++c)
        uses.push_back({pairKey(beginOf(mesh, c), endOf(mesh, c)), c});
    std::sort(uses.begin(), uses.end());
    for (size_t i = 0, end; i < uses.size(); i = end) {
        for (end = i; end < uses.size() && uses[end].pair == uses[i].pair;) ++end;
        visit(std::span(uses).subspan(i, end - i));
    }
}

bool isRegular(const Mesh& mesh, std::span<const EdgeUse> uses) {
    return uses.size() == 2 && beginOf(mesh, uses[0].corner) == endOf(mesh, uses[1].corner);
}

}  // namespace

bool fanMayMerge(const PolygonMesh& mesh, std::span<const uint32_t> fan) {
    // Few of each: looked through, not searched.
    std::vector<uint32_t> faces, vertices, begins;
    const auto has = [](const std::vector<uint32_t>& values, uint32_t value) {
        return std::find(values.begin(), values.end(), value) != values.end();
    };
    for (const uint32_t h : fan) {
        if (has(faces, mesh.face[h])) return false;
        faces.push_back(mesh.face[h]);
    }
    size_t half_edges = 0;
    for (const uint32_t f : faces)
        for (uint32_t h = mesh.face_begin[f]; h < mesh.face_begin[f + 1]; ++h) {
            ++half_edges;
            const uint32_t v = mesh.corner[h], t = mesh.twin[h];
            if (!has(vertices, v)) vertices.push_back(v);
            if (t != kNone && has(faces, mesh.face[t])) continue;
            if (has(begins, v)) return false;
            begins.push_back(v);
        }
    if (begins.size() < 4) return false;
    // One piece, as all faces share the vertex: a disc by Euler's count, if it is one outline.
    const size_t edges = (half_edges + begins.size()) / 2;
    return vertices.size() + faces.size() == edges + 1;
}

Interfaces::Interfaces(const Mesh& mesh, const CellTriangles& cells)
    : position_(mesh.position),
      irregular_(mesh.vertexCount(), 0),
      at_interface_(mesh.vertexCount(), 0),
      pinned_(mesh.vertexCount(), 1),
      just_removed_(mesh.vertexCount(), 0),
      neighbour_(mesh.vertexCount(), {kNone, kNone}),
      cells_at_(mesh.vertexCount(), {kNone, kNone}) {
    std::vector<uint32_t> cell_of(mesh.triangleCount(), kNone);
    for (uint32_t c = 0; c < cells.of_cell.size(); ++c)
        for (const uint32_t t : cells.of_cell[c]) cell_of[t] = c;
    findIrregular(mesh);
    findInterfaces(mesh, cell_of);
    pinLoops();
}

/// Irregular is what has an edge that is neither a border nor used once in either direction, or
/// whose triangles are not one fan.
void Interfaces::findIrregular(const Mesh& mesh) {
    DisjointSets corners(3 * mesh.triangleCount());
    forEachEdge(mesh, [&](std::span<const EdgeUse> uses) {
        if (isRegular(mesh, uses)) {
            for (const auto& [one, other] : {std::pair(uses[0], uses[1]), {uses[1], uses[0]}}) {
                const uint32_t t = other.corner / 3 * 3;
                corners.unite(one.corner, t + (other.corner - t + 1) % 3);
            }
        } else if (uses.size() > 1) {
            irregular_[beginOf(mesh, uses[0].corner)] = irregular_[endOf(mesh, uses[0].corner)] = 1;
        }
    });
    std::vector<uint32_t> fan(mesh.vertexCount(), kNone);
    for (uint32_t c = 0; c < 3 * mesh.triangleCount(); ++c) {
        uint32_t& at = fan[beginOf(mesh, c)];
        if (at != kNone && at != corners.root(c)) irregular_[beginOf(mesh, c)] = 1;
        at = corners.root(c);
    }
}

void Interfaces::findInterfaces(const Mesh& mesh, std::span<const uint32_t> cell_of) {
    for (uint32_t t = 0; t < mesh.triangleCount(); ++t)
        for (const uint32_t v : mesh.triangle[t]) {
            auto& [first, second] = cells_at_[v];
            const uint32_t cell = cell_of[t];
            if (cell == first || cell == second) continue;
            if (first == kNone)
                first = cell;
            else if (second == kNone)
                second = cell;
            else
                irregular_[v] |= 2;  // three cells meet
            at_interface_[v] = second != kNone;
        }
    for (auto& [first, second] : cells_at_)
        if (second != kNone && second < first) std::swap(first, second);
    std::vector<uint8_t> edges_at(mesh.vertexCount(), 0), at_border(mesh.vertexCount(), 0);
    forEachEdge(mesh, [&](std::span<const EdgeUse> uses) {
        const uint32_t a = beginOf(mesh, uses[0].corner), b = endOf(mesh, uses[0].corner);
        if (at_interface_[a] && at_interface_[b]) joined_.push_back(uses[0].pair);
        if (uses.size() == 1) at_border[a] = at_border[b] = 1;
        if (!isRegular(mesh, uses)) return;
        const std::array cells = {cell_of[uses[0].corner / 3], cell_of[uses[1].corner / 3]};
        if (cells[0] == cells[1]) return;
        edges_at[a] = uint8_t(std::min(3, edges_at[a] + 1));
        edges_at[b] = uint8_t(std::min(3, edges_at[b] + 1));
        // The first cell has it from a to b.
        const bool forward = cells[0] == std::min(cells[0], cells[1]);
        neighbour_[forward ? a : b][1] = forward ? b : a;
        neighbour_[forward ? b : a][0] = forward ? a : b;
    });
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
        pinned_[v] = !at_interface_[v] || irregular_[v] || at_border[v] || edges_at[v] != 2 ||
                     neighbour_[v][0] == kNone || neighbour_[v][1] == kNone;
        irregular_[v] &= 1;
    }
}

/// Interfaces that are closed, but for one pinned vertex at most, get three.
void Interfaces::pinLoops() {
    std::vector<uint8_t> seen(pinned_);
    // Open chains first: what is left then are closed ones.
    for (const bool closed : {false, true})
        for (uint32_t v = 0; v < seen.size(); ++v) {
            if (seen[v] || (!closed && !pinned_[neighbour_[v][0]])) continue;
            std::vector<uint32_t> chain;
            uint32_t at = v;
            for (; !seen[at]; at = neighbour_[at][1]) {
                seen[at] = 1;
                chain.push_back(at);
            }
            if (closed) pinned_[v] = 1;
            if (closed || neighbour_[v][0] == at)
                pinned_[chain[chain.size() / 3]] = pinned_[chain[2 * chain.size() / 3]] = 1;
        }
}

uint32_t Interfaces::pinnedCount() const {
    uint32_t count = 0;
    for (uint32_t v = 0; v < pinned_.size(); ++v) count += at_interface_[v] && pinned_[v];
    return count;
}

bool Interfaces::mayBeRemoved(uint32_t v) const {
    if (pinned_[v]) return false;
    const auto [a, b] = neighbour_[v];
    return !(pinned_[a] && pinned_[b]) &&
           !std::binary_search(joined_.begin(), joined_.end(), pairKey(a, b));
}

/// Squared deviation of the outline.
double Interfaces::costOf(uint32_t v) const {
    const Vec3d a(position_[neighbour_[v][0]]), b(position_[neighbour_[v][1]]);
    const Vec3d across = glm::cross(b - a, Vec3d(position_[v]) - a);
    return glm::dot(across, across) / glm::dot(b - a, b - a);
}

/// What both cells can do without, and which of these exclude each other, neighbours apart.
std::vector<Interfaces::Candidate> Interfaces::candidates(
    std::span<const PolygonMesh> cells, std::vector<std::array<uint32_t, 2>>& conflicts) const {
    std::vector<uint8_t> votes(position_.size(), 0);
    std::vector<uint32_t> at_face;
    std::vector<uint32_t> voted;
    for (const PolygonMesh& cell : cells) {
        const Corners corners(cell);
        std::vector<Candidate> own;
        for (uint32_t v = 0; v < cell.vertexCount(); ++v)
            if (const uint32_t name = cell.name[v];
                cell.interface_[v] && mayBeRemoved(name) && fanMayMerge(cell, corners.at(v)))
                own.push_back({costOf(name), name});
        std::sort(own.begin(), own.end());
        own.resize(own.size() - own.size() / kKeptPart);
        for (const Candidate& c : own) {
            ++votes[c.vertex];
            voted.push_back(c.vertex);
        }
        // A face may lose several corners: as no two are neighbours, and not both neighbours of one
        // are pinned, three stay. Where faces merge around one, nothing else leaves them.
        for (uint32_t f = 0; f < cell.faceCount(); ++f) {
            at_face.clear();
            for (uint32_t h = cell.face_begin[f]; h < cell.face_begin[f + 1]; ++h)
                if (votes[cell.name[cell.corner[h]]]) at_face.push_back(cell.corner[h]);
            for (const uint32_t p : at_face)
                for (const uint32_t q : at_face)
                    if (p != q && (corners.at(p).size() > 1 || corners.at(q).size() > 1))
                        conflicts.push_back({cell.name[p], cell.name[q]});
        }
    }
    std::vector<Candidate> both;
    for (const uint32_t v : voted) {
        if (votes[v] != 2) continue;
        votes[v] = 0;
        both.push_back({costOf(v), v});
    }
    std::sort(both.begin(), both.end());
    std::sort(conflicts.begin(), conflicts.end());
    return both;
}

void Interfaces::removeFor(uint16_t layer, std::span<const PolygonMesh> cells) {
    std::fill(just_removed_.begin(), just_removed_.end(), 0);
    std::vector<std::array<uint32_t, 2>> conflicts;
    const std::vector<Candidate> order = candidates(cells, conflicts);
    std::vector<uint8_t> blocked(position_.size(), 0);
    for (const Candidate& candidate : order) {
        const uint32_t v = candidate.vertex;
        if (blocked[v]) continue;
        auto at = std::lower_bound(conflicts.begin(), conflicts.end(), std::array{v, 0u});
        for (; at != conflicts.end() && (*at)[0] == v; ++at) blocked[(*at)[1]] = 1;
        const auto [a, b] = neighbour_[v];
        blocked[a] = blocked[b] = 1;
        just_removed_[v] = 1;
        strips_.push_back({v, a, b, cells_at_[v], layer});
    }
    for (const Candidate& candidate : order)
        if (just_removed_[candidate.vertex]) remove(candidate.vertex);
}

/// Its neighbours become each other's. Between other cells, a pinned one has neighbours that
/// nobody asks for.
void Interfaces::remove(uint32_t v) {
    const auto [a, b] = neighbour_[v];
    neighbour_[a][1] = b;
    neighbour_[b][0] = a;
    pinned_[v] = 1;
}

Groups fansWithout(const PolygonMesh& cell, std::span<const uint8_t> removed) {
    DisjointSets fans(cell.faceCount());
    std::vector<uint32_t> first(cell.vertexCount(), kNone);
    for (uint32_t h = 0; h < cell.halfEdgeCount(); ++h) {
        const uint32_t v = cell.corner[h];
        if (!removed[cell.name[v]]) continue;
        if (first[v] == kNone) first[v] = cell.face[h];
        fans.unite(first[v], cell.face[h]);
    }
    Groups groups;
    for (uint32_t f = 0; f < cell.faceCount(); ++f)
        groups.of_face.push_back(fans.root(f) == f ? groups.count++ : groups.of_face[fans.root(f)]);
    return groups;
}

}  // namespace pietra::cluster
