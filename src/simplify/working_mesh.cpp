#include "simplify/working_mesh.h"

#include <algorithm>

#include "base/check.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"

namespace pietra {
namespace {

Vec3i centreOf(const Mesh& mesh) {
    if (mesh.position.empty()) return {0, 0, 0};
    Box3i box;
    for (const Vec3i& p : mesh.position) box.add(p);
    const Vec3i middle = box.min + (box.max - box.min) / 2;
    return snapToShift(middle, kMaxLatticeShift);
}

}  // namespace

void WorkingMesh::load(const Mesh& in, std::span<const uint8_t> cell,
                       std::span<const uint32_t> quota) {
    CHECK_EQ(cell.size(), in.triangleCount());
    CHECK_LE(quota.size(), cell_quota.size());
    CHECK_EQ(in.edge_class.size(), in.triangleCount());
    centre = centreOf(in);
    point.resize(in.vertexCount());
    for (size_t v = 0; v < in.vertexCount(); ++v) {
        const Vec3i p = in.position[v] - centre;
        point[v] = {float(p.x), float(p.y), float(p.z), 0};
    }
    cell_count.fill(0);
    cell_quota.fill(0);
    for (size_t c = 0; c < quota.size(); ++c)
        cell_quota[c] = std::min(quota[c], uint32_t(in.triangleCount()));
    face.resize(in.triangleCount());
    for (size_t t = 0; t < in.triangleCount(); ++t) {
        const Triangle& c = in.triangle[t];
        face[t] = {{c[0], c[1], c[2]}, uint32_t(cell[t]) | uint32_t(in.edge_class[t]) << 8};
        ++cell_count[cell[t]];
    }
    cells_above = 0;
    for (uint32_t c = 0; c < cell_count.size(); ++c) cells_above += cellAbove(c);
    parent.resize(in.vertexCount());
    for (uint32_t v = 0; v < parent.size(); ++v) parent[v] = v;
    buildFans();
}

void WorkingMesh::buildFans() {
    fan.assign(point.size(), Fan{0, 0});
    stamp.assign(point.size(), 0);
    mark.assign(point.size(), 0);
    epoch = 0;
    for (const Face& f : face)
        for (const uint32_t v : f.v) ++fan[v].count;
    uint32_t begin = 0;
    for (Fan& f : fan) {
        f.begin = begin;
        begin += f.count;
        f.count = 0;
    }
    corner_end = begin;
    corner.resize(std::max(corner.size(), size_t(begin)));
    for (uint32_t f = 0; f < face.size(); ++f)
        for (uint32_t k = 0; k < 3; ++k) {
            Fan& of_corner = fan[face[f].v[k]];
            corner[of_corner.begin + of_corner.count++] = 4 * f + k;
        }
}

}  // namespace pietra
