#pragma once
// Meshes for the tests of this folder, and what it means for two meshes to hold the same.

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <random>
#include <vector>

#include "geometry/lattice.h"
#include "geometry/mesh.h"
#include "store/page_codec.h"

namespace pietra::testing {

using Random = std::mt19937;

inline uint32_t below(Random& random, uint32_t limit) {
    return uint32_t(random() % limit);
}

/// Gives each vertex attributes and each triangle edge classes; `wild` ones are noise.
inline void addAttributes(Mesh& mesh, const PageSettings& settings, Random& random, bool wild) {
    const size_t n = mesh.vertexCount();
    mesh.normal.resize(n);
    mesh.colour.resize(settings.colours ? n : 0);
    mesh.scalar.resize(n * size_t(settings.scalar_count));
    mesh.edge_class.assign(mesh.triangleCount(), 0);
    for (size_t v = 0; v < n; ++v) {
        const Vec3f p(mesh.position[v]);
        const Vec3f direction =
            wild ? Vec3f(float(below(random, 201)) - 100, float(below(random, 201)) - 100,
                         float(below(random, 201)) - 100)
                 : p - Vec3f(1 << 20);
        mesh.normal[v] = encodeNormal(direction);
        if (settings.colours) {
            const auto c = wild ? uint32_t(random()) : uint32_t(mesh.position[v].x >> 8);
            mesh.colour[v] = {uint8_t(c), uint8_t(c >> 8), uint8_t(c >> 16), 255};
        }
    }
    for (float& s : mesh.scalar)
        s = wild ? std::bit_cast<float>(uint32_t(random()) & 0x7f7fffff) : 1.5f;
    if (wild)
        for (uint8_t& classes : mesh.edge_class)
            if (below(random, 4) == 0) classes = uint8_t(below(random, 64));
}

/// A wavy sheet of columns x rows quads; positions on the sub-lattice.
inline Mesh makeSheet(int columns, int rows, const PageSettings& settings, Random& random,
                      int step = 40) {
    Mesh mesh;
    for (int y = 0; y <= rows; ++y)
        for (int x = 0; x <= columns; ++x) {
            const double wave = 2000 * std::sin(x * 0.1) * std::cos(y * 0.07);
            const Vec3i noise(below(random, 9), below(random, 9), below(random, 9));
            const Vec3i p = Vec3i(300000 + x * step, 200000 + y * step, 100000 + int(wave)) + noise;
            mesh.position.push_back(snapToShift(p, settings.shift));
        }
    const auto at = [&](int x, int y) { return uint32_t(y * (columns + 1) + x); };
    for (int y = 0; y < rows; ++y)
        for (int x = 0; x < columns; ++x) {
            mesh.triangle.push_back({at(x, y), at(x + 1, y), at(x, y + 1)});
            mesh.triangle.push_back({at(x + 1, y), at(x + 1, y + 1), at(x, y + 1)});
        }
    addAttributes(mesh, settings, random, false);
    return mesh;
}

/// A closed surface: an octahedron subdivided `levels` times, pushed onto a sphere.
inline Mesh makeSphere(int levels, const PageSettings& settings, Random& random) {
    const int n = 1 << levels;
    Mesh mesh;
    std::vector<uint64_t> keys;
    const auto vertex = [&](const Vec3i& corner) {
        const Vec3d unit = glm::normalize(Vec3d(corner));
        const Vec3i p = snapToShift(Vec3i(Vec3d(1 << 20) + unit * 500000.0), settings.shift);
        const uint64_t key = latticeKey(p);
        const auto found = std::find(keys.begin(), keys.end(), key);
        if (found != keys.end()) return uint32_t(found - keys.begin());
        keys.push_back(key);
        mesh.position.push_back(p);
        return uint32_t(keys.size() - 1);
    };
    for (int face = 0; face < 8; ++face) {
        const Vec3i sign((face & 1) ? -1 : 1, (face & 2) ? -1 : 1, (face & 4) ? -1 : 1);
        const bool flip = sign.x * sign.y * sign.z < 0;
        const auto at = [&](int i, int j) { return vertex(Vec3i(i, j, n - i - j) * sign); };
        const auto add = [&](uint32_t a, uint32_t b, uint32_t c) {
            mesh.triangle.push_back(flip ? Triangle{a, c, b} : Triangle{a, b, c});
        };
        for (int i = 0; i < n; ++i)
            for (int j = 0; i + j < n; ++j) {
                add(at(i, j), at(i + 1, j), at(i, j + 1));
                if (i + j + 1 < n) add(at(i + 1, j), at(i + 1, j + 1), at(i, j + 1));
            }
    }
    addAttributes(mesh, settings, random, false);
    return mesh;
}

/// Triangles between random vertices: non-manifold edges and vertices, double triangles, vertices
/// that nothing uses, several vertices at one point; no triangle uses a vertex twice.
inline Mesh makeSoup(uint32_t vertices, uint32_t triangles, const PageSettings& settings,
                     Random& random) {
    Mesh mesh;
    for (uint32_t v = 0; v < vertices; ++v) {
        Vec3i p;
        for (int axis = 0; axis < 3; ++axis) {
            const bool extreme = below(random, 8) == 0;
            const int32_t x = extreme ? (below(random, 2) ? kLatticeMax : 0)
                                      : int32_t(below(random, uint32_t(kLatticeMax)));
            p[axis] = x >> settings.shift << settings.shift;
        }
        mesh.position.push_back(p);
    }
    while (mesh.triangle.size() < triangles) {
        const Triangle t{below(random, vertices), below(random, vertices), below(random, vertices)};
        if (t[0] != t[1] && t[1] != t[2] && t[2] != t[0]) mesh.triangle.push_back(t);
    }
    addAttributes(mesh, settings, random, true);
    return mesh;
}

/// Everything a vertex carries, with the normal as a page keeps it: position, normal, colour,
/// scalars.
inline constexpr int kMostTestScalars = 5;
using VertexValue = std::array<uint32_t, 6 + kMostTestScalars>;
/// The three vertices in order, the least first, and the class of the edge after each.
using TriangleValue = std::array<std::pair<VertexValue, int>, 3>;

inline VertexValue vertexValue(const Mesh& mesh, size_t v, int normal_bits) {
    const auto normal = [&](int16_t x) {
        const int code = quantiseNormal(std::max<int>(x, -32767), normal_bits);
        return uint32_t(restoreNormal(code, normal_bits));
    };
    const Vec3i p = mesh.position[v];
    const uint32_t colour = mesh.colour.empty() ? 0 : std::bit_cast<uint32_t>(mesh.colour[v]);
    VertexValue value = {uint32_t(p.x),
                         uint32_t(p.y),
                         uint32_t(p.z),
                         normal(mesh.normal[v].x),
                         normal(mesh.normal[v].y),
                         colour};
    const size_t scalars = mesh.scalar.size() / mesh.vertexCount();
    for (size_t s = 0; s < scalars; ++s)
        value[6 + s] = std::bit_cast<uint32_t>(mesh.scalar[v * scalars + s]);
    return value;
}

/// What must survive a page, in a canonical order: all triangles and all vertices.
inline std::pair<std::vector<TriangleValue>, std::vector<VertexValue>> content(const Mesh& mesh,
                                                                               int normal_bits) {
    std::vector<VertexValue> vertices;
    for (size_t v = 0; v < mesh.vertexCount(); ++v)
        vertices.push_back(vertexValue(mesh, v, normal_bits));
    std::vector<TriangleValue> triangles;
    for (size_t i = 0; i < mesh.triangleCount(); ++i) {
        TriangleValue t;
        for (int k = 0; k < 3; ++k)
            t[k] = {vertices[mesh.triangle[i][k]], int(mesh.edgeClass(i, k))};
        TriangleValue least = t;
        for (int turn = 0; turn < 2; ++turn) {
            std::rotate(t.begin(), t.begin() + 1, t.end());
            least = std::min(least, t);
        }
        triangles.push_back(least);
    }
    std::sort(vertices.begin(), vertices.end());
    std::sort(triangles.begin(), triangles.end());
    return {std::move(triangles), std::move(vertices)};
}

}  // namespace pietra::testing
