#include "methods/pmesh/whole_mesh.h"

#include <algorithm>

#include "coarsen/key_map.h"
#include "coarsen/precision.h"
#include "coarsen/triangle_ahead.h"
#include "coarsen/vertex_table.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kBatchTriangles = 1 << 18;
constexpr size_t kBytesATriangle = 100;

/// Of triangles with the same corners, whatever their orientation, the first stays.
uint64_t dropDuplicates(std::vector<Triangle>& triangles) {
    struct Entry {
        Triangle corners;
        uint32_t place;
        auto operator<=>(const Entry&) const = default;
    };
    std::vector<Entry> sorted(triangles.size());
    for (uint32_t t = 0; t < sorted.size(); ++t) {
        sorted[t] = {triangles[t], t};
        std::sort(sorted[t].corners.begin(), sorted[t].corners.end());
    }
    std::sort(sorted.begin(), sorted.end());
    std::vector<uint8_t> doubled(triangles.size(), 0);
    for (size_t i = 1; i < sorted.size(); ++i)
        doubled[sorted[i].place] = sorted[i].corners == sorted[i - 1].corners;
    size_t kept = 0;
    for (size_t t = 0; t < triangles.size(); ++t)
        if (!doubled[t]) triangles[kept++] = triangles[t];
    const uint64_t dropped = triangles.size() - kept;
    triangles.resize(kept);
    return dropped;
}

void computeNormals(Mesh& mesh) {
    std::vector<Vec3l> sum(mesh.vertexCount(), Vec3l(0));  // integers: in any order the same
    for (const Triangle& t : mesh.triangle) {
        const Vec3l a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
        const Vec3l normal = crossInteger(b - a, c - a);
        for (const uint32_t v : t) sum[v] += normal;
    }
    for (const Vec3l& n : sum) mesh.normal.push_back(encodeNormal(Vec3f(n)));
}

}  // namespace

WholeMesh readWholeMesh(TriangleSource& source, const std::string& input_name,
                        const PrecisionSetting& precision, TempSpace& space, Progress& progress) {
    const Reservation memory = space.budget->reserve(kBytesATriangle * source.triangleCountHint(),
                                                     "a whole mesh in memory");
    VertexTable vertices(source, input_name, precision, space, progress);
    if (precision.kind == PrecisionSetting::Kind::kAuto)
        vertices.setShift(chooseShift(source, vertices, kBatchTriangles, progress));
    WholeMesh whole;
    whole.lattice = vertices.lattice();
    whole.bounds = vertices.bounds();
    whole.quantisation_error = vertices.quantisationError();
    whole.input_vertices = vertices.size();
    Mesh& mesh = whole.mesh;
    KeyMap map;
    TriangleAhead ahead(source, kBatchTriangles);
    std::vector<std::array<uint64_t, 3>> index;
    std::vector<std::byte> keys;
    while (ahead.next(index)) {
        vertices.gather(index, keys, true);
        for (size_t t = 0; t < index.size(); ++t) {
            std::array<uint64_t, 3> key;
            std::memcpy(key.data(), &keys[24 * t], 24);
            if (key[0] == key[1] || key[1] == key[2] || key[2] == key[0]) {
                ++whole.dropped_degenerate;
                continue;
            }
            Triangle& to = mesh.triangle.emplace_back();
            for (size_t k = 0; k < 3; ++k) {
                const auto [v, is_new] = map.insert(key[k], uint32_t(mesh.position.size()));
                if (is_new) mesh.position.push_back(latticePoint(key[k]));
                to[k] = v;
            }
        }
    }
    whole.dropped_duplicate = dropDuplicates(mesh.triangle);
    computeNormals(mesh);
    return whole;
}

}  // namespace pietra::pmesh
