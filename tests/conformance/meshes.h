#pragma once
// Small inputs of every kind that a method must cope with: closed, bordered, non-manifold, dust.

#include <cmath>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "audit/conformance_inputs.h"
#include "base/hash.h"
#include "io/memory_source.h"

namespace pietra {

struct ConformanceMesh {
    std::string name;
    AttributeSchema schema;
    VertexBatch vertices;
    std::vector<std::array<uint64_t, 3>> triangles;

    uint64_t add(const Vec3d& p) {
        vertices.position.push_back(p);
        return vertices.position.size() - 1;
    }
    std::unique_ptr<TriangleSource> source() const {
        return std::make_unique<MemorySource>(schema, vertices, triangles);
    }
};

/// Reproducible noise in [0, 1) from a position.
inline double noiseAt(const Vec3d& p) {
    const auto bits = [](double x) { return uint64_t(int64_t(std::floor(x * 1e6 + 0.5))); };
    return double(mixBits(bits(p.x) * 3 + bits(p.y) * 5 + bits(p.z) * 7) >> 11) * 0x1p-53;
}

/// n x n quads over [0, 1]^2, of which `hole` says which are missing.
template <class Height, class Hole>
void addGrid(ConformanceMesh& mesh, int n, Height&& height, Hole&& hole) {
    const uint64_t first = mesh.vertices.position.size();
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x)
            mesh.add({double(x) / n, double(y) / n, height(double(x) / n, double(y) / n)});
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            if (hole(x, y)) continue;
            const uint64_t a = first + uint64_t(y * (n + 1) + x), b = a + 1;
            const uint64_t c = a + uint64_t(n) + 1, d = c + 1;
            mesh.triangles.push_back({a, b, c});
            mesh.triangles.push_back({b, d, c});
        }
}

inline ConformanceMesh named(const std::string& name, const MemorySource& mesh) {
    return {name, mesh.attributes, mesh.vertices, mesh.triangles};
}

/// A closed, dented sphere.
inline ConformanceMesh closedMesh(int n) {
    return named("closed", inputs::ball(n, 0.2));
}

/// A bordered terrain with a hole, colours and a scalar.
inline ConformanceMesh borderedMesh(int n) {
    ConformanceMesh mesh;
    mesh.name = "bordered";
    mesh.schema.colours = true;
    mesh.schema.scalars = {"height"};
    addGrid(
        mesh, n,
        [](double x, double y) {
            return 0.2 * x * (1 - x) * y + 0.02 * noiseAt({x, y, 0}) + (x + y > 1.1 ? 0.1 : 0.0);
        },
        [n](int x, int y) { return x > n / 3 && x < n / 2 && y > n / 4 && y < n / 2; });
    for (const Vec3d& p : mesh.vertices.position) {
        mesh.vertices.colour.push_back(
            {uint8_t(p.x * 255), uint8_t(p.y * 255), uint8_t(p.x > 0.5 ? 255 : 0), 255});
        mesh.vertices.scalar.push_back(float(p.z));
    }
    return mesh;
}

/// Sheets that meet in lines, and a Moebius strip.
inline ConformanceMesh nonManifoldMesh() {
    return named("non-manifold", inputs::nonManifold());
}

/// Thousands of loose tetrahedra and single triangles.
inline ConformanceMesh dustMesh(int count) {
    ConformanceMesh mesh;
    mesh.name = "dust";
    std::mt19937 random(5);
    const auto uniform = [&] { return double(random() >> 5) * 0x1p-27; };
    for (int i = 0; i < count; ++i) {
        const Vec3d centre(uniform(), uniform() * uniform(), uniform());
        uint64_t v[4];
        for (uint64_t& k : v) k = mesh.add(centre + 0.004 * Vec3d(uniform(), uniform(), uniform()));
        mesh.triangles.push_back({v[0], v[1], v[2]});
        if (i % 3 == 0) continue;
        mesh.triangles.push_back({v[0], v[3], v[1]});
        mesh.triangles.push_back({v[1], v[3], v[2]});
        mesh.triangles.push_back({v[2], v[3], v[0]});
    }
    return mesh;
}

}  // namespace pietra
