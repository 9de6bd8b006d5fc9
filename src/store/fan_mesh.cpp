#include "store/fan_mesh.h"

namespace pietra {

bool FanMesh::build(const Mesh& mesh) {
    first_.assign(mesh.vertexCount() + 1, 0);
    for (const Triangle& t : mesh.triangle) {
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return false;
        for (const uint32_t v : t) ++first_[v];
    }
    uint32_t sum = 0;
    for (size_t v = 0; v < mesh.vertexCount(); ++v) {
        if (first_[v] == 0) return false;
        sum += first_[v];
        first_[v] = sum;  // the end of the run; filling it moves this to its begin
    }
    first_.back() = sum;
    leaving_.resize(sum);
    for (auto t = uint32_t(mesh.triangleCount()); t-- > 0;)
        for (uint32_t k = 3; k-- > 0;) leaving_[--first_[mesh.triangle[t][k]]] = 4 * t + k;
    pairHalfEdges(mesh);
    splitIntoFans(mesh);
    return true;
}

void FanMesh::pairHalfEdges(const Mesh& mesh) {
    opposite.assign(4 * mesh.triangleCount(), kNone);
    slots_.assign(mesh.vertexCount(), {kNone, kNone, kNone});
    const auto startOf = [&](uint32_t h) { return mesh.triangle[h >> 2][h & 3]; };
    // Each edge from its lower end: first what leaves this, then what arrives.
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v) {
        for (uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
            const uint32_t w = startOf(nextHalfEdge(leaving_[i]));
            if (w < v) continue;
            Slot& slot = slots_[w];
            slot = {v, slot.vertex == v ? kNone : leaving_[i], kNone};
        }
        for (uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
            const uint32_t h = previousHalfEdge(leaving_[i]);
            const uint32_t w = startOf(h);
            Slot& slot = slots_[w];
            if (w < v || slot.vertex != v || slot.leaving == kNone) continue;
            const bool first = slot.arriving == kNone;
            opposite[first ? h : slot.arriving] = first ? slot.leaving : kNone;
            opposite[slot.leaving] = first ? h : kNone;
            if (first)
                slot.arriving = h;
            else
                slot.leaving = kNone;
        }
    }
}

void FanMesh::splitIntoFans(const Mesh& mesh) {
    corner.assign(opposite.size(), kNone);
    origin.clear();
    valence.clear();
    border.clear();
    for (const uint32_t h : leaving_) {
        if (corner[h] != kNone) continue;
        const auto fan = uint32_t(origin.size());
        uint32_t count = 0, leaves = kNone;
        // Counter-clockwise from h; if that ends at a border, clockwise from h too.
        uint32_t at = h;
        do {
            corner[at] = fan;
            ++count;
            at = opposite[previousHalfEdge(at)];
        } while (at != kNone && at != h);
        if (at == kNone)
            for (leaves = h; opposite[leaves] != kNone; ++count) {
                leaves = nextHalfEdge(opposite[leaves]);
                corner[leaves] = fan;
            }
        origin.push_back(mesh.triangle[h >> 2][h & 3]);
        valence.push_back(count);
        border.push_back(leaves);
    }
}

}  // namespace pietra
