#include "store/fan_mesh.h"

namespace pietra {

bool FanMesh::build(const Mesh& mesh) {
    for (const Triangle& t : mesh.triangle)
        if (t[0] == t[1] || t[1] == t[2] || t[2] == t[0]) return false;
    first_.assign(mesh.vertexCount() + 1, 0);
    for (const Triangle& t : mesh.triangle)
        for (const uint32_t v : t) ++first_[v];
    uint32_t sum = 0;
    for (uint32_t& entry : first_) {
        if (entry == 0 && &entry != &first_.back()) return false;
        sum += entry;
        entry = sum;  // the end of each run; filling moves it to the begin
    }
    pairHalfEdges(mesh);
    splitIntoFans(mesh);
    return true;
}

void FanMesh::pairHalfEdges(const Mesh& mesh) {
    const auto m = uint32_t(mesh.triangleCount());
    leaving_.resize(3 * size_t(m));
    for (uint32_t t = m; t-- > 0;)
        for (uint32_t k = 3; k-- > 0;) {
            const uint32_t from = mesh.triangle[t][k], to = mesh.triangle[t][k == 2 ? 0 : k + 1];
            leaving_[--first_[from]] = {to, 3 * t + k};
        }
    opposite.assign(3 * size_t(m), kNone);
    const auto only = [&](uint32_t from, uint32_t to) {  // the half-edge, if there is just one
        uint32_t found = kNone;
        for (uint32_t i = first_[from]; i < first_[from + 1]; ++i) {
            if (leaving_[i].target != to) continue;
            if (found != kNone) return kNone;
            found = leaving_[i].half_edge;
        }
        return found;
    };
    for (uint32_t v = 0; v < mesh.vertexCount(); ++v)
        for (uint32_t i = first_[v]; i < first_[v + 1]; ++i) {
            const uint32_t w = leaving_[i].target;
            if (w < v) continue;
            const uint32_t back = only(w, v);
            if (back == kNone || only(v, w) == kNone) continue;
            opposite[leaving_[i].half_edge] = back;
            opposite[back] = leaving_[i].half_edge;
        }
}

void FanMesh::splitIntoFans(const Mesh& mesh) {
    const size_t half_edges = opposite.size();
    corner.assign(half_edges, kNone);
    origin.clear();
    valence.clear();
    border.clear();
    for (uint32_t h = 0; h < half_edges; ++h) {
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
        if (at == kNone) {
            leaves = h;
            while (opposite[leaves] != kNone) {
                leaves = nextHalfEdge(opposite[leaves]);
                corner[leaves] = fan;
                ++count;
            }
        }
        origin.push_back(mesh.triangle[h / 3][h % 3]);
        valence.push_back(count);
        border.push_back(leaves);
    }
}

}  // namespace pietra
