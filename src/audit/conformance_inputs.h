#pragma once
// Small meshes that have made simplifiers and builders stumble, as inputs in memory: for the
// conformance suite and for tests of the builders.

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <map>
#include <memory>
#include <numbers>
#include <string>
#include <vector>

#include "base/hash.h"
#include "io/memory_source.h"

namespace pietra {

struct ConformanceInput {
    std::string name;
    std::function<std::unique_ptr<TriangleSource>()> open;
};

namespace inputs {

/// In [-1, 1), a function of the place.
inline double noise(uint64_t a, uint64_t b) {
    return double(mixBits(mixBits(a) + b) >> 11) * 0x1p-52 - 1;
}

/// Height field of n by n squares with noise, and without the squares for which hole(x, y).
template <class Hole>
MemorySource sheet(int n, double roughness, Hole&& hole) {
    MemorySource mesh;
    for (int y = 0; y <= n; ++y)
        for (int x = 0; x <= n; ++x)
            mesh.vertices.position.push_back({double(x), double(y),
                                              4 * std::sin(x * 0.21) * std::cos(y * 0.17) +
                                                  roughness * noise(uint64_t(x), uint64_t(y))});
    const auto at = [n](int x, int y) { return uint64_t(y * (n + 1) + x); };
    for (int y = 0; y < n; ++y)
        for (int x = 0; x < n; ++x) {
            if (hole(x, y)) continue;
            mesh.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
            mesh.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
        }
    return mesh;
}

/// Closed: the surface of a cube of n by n squares a side, blown up to a bumpy ball.
inline MemorySource ball(int n, double roughness) {
    MemorySource mesh;
    std::map<std::array<int, 3>, uint64_t> index;
    const auto vertex = [&](const Vec3i& p) {
        const auto [it, is_new] = index.try_emplace({p.x, p.y, p.z}, mesh.vertices.position.size());
        if (is_new) {
            const Vec3d direction = glm::normalize(Vec3d(2 * p - n));
            const double bump = roughness * noise(uint64_t(p.x * 1024 + p.y), uint64_t(p.z));
            mesh.vertices.position.push_back(direction *
                                             (50 + 3 * std::sin(direction.x * 9) + bump));
        }
        return it->second;
    };
    for (int axis = 0; axis < 3; ++axis)
        for (const int side : {0, n})
            for (int v = 0; v < n; ++v)
                for (int u = 0; u < n; ++u) {
                    const auto corner = [&](int du, int dv) {
                        Vec3i p;
                        p[axis] = side;
                        p[(axis + 1) % 3] = side == 0 ? v + dv : u + du;
                        p[(axis + 2) % 3] = side == 0 ? u + du : v + dv;
                        return vertex(p);
                    };
                    const uint64_t a = corner(0, 0), b = corner(1, 0), c = corner(1, 1),
                                   d = corner(0, 1);
                    mesh.triangles.push_back({a, b, c});
                    mesh.triangles.push_back({a, c, d});
                }
    return mesh;
}

inline void append(MemorySource& mesh, const MemorySource& other, const Vec3d& shift) {
    const uint64_t base = mesh.vertices.position.size();
    for (const Vec3d& p : other.vertices.position) mesh.vertices.position.push_back(p + shift);
    for (const auto& [a, b, c] : other.triangles)
        mesh.triangles.push_back({base + a, base + b, base + c});
}

inline MemorySource tetrahedron(double size) {
    return {{{0, 0, 0}, {size, 0, 0}, {0, size, 0}, {0, 0, size}},
            {{0, 2, 1}, {0, 1, 3}, {0, 3, 2}, {1, 2, 3}}};
}

/// Nothing but small closed components, some of which touch in a point.
inline MemorySource dust() {
    MemorySource mesh;
    for (int k = 0; k < 2000; ++k) {
        const uint64_t key = uint64_t(k);
        append(mesh, tetrahedron(1),
               Vec3d(k % 13, k / 13 % 13, k / 169) * (k % 3 == 0 ? 1.0 : 1.5) +
                   0.01 * double(k % 3) * noise(key, 1));
    }
    return mesh;
}

/// Pages that meet in a spine: edges with three and with five triangles; and a Moebius strip, which
/// cannot be oriented.
inline MemorySource nonManifold() {
    MemorySource mesh;
    const int n = 40;
    for (const int pages : {3, 5}) {
        MemorySource book;
        for (int y = 0; y <= n; ++y) book.vertices.position.push_back({0, double(y), 0});
        for (int page = 0; page < pages; ++page) {
            const double angle = 2 * std::numbers::pi * page / pages;
            const uint64_t base = book.vertices.position.size();
            const auto at = [&](int x, int y) {
                return x == 0 ? uint64_t(y) : base + uint64_t(y * n + x - 1);
            };
            for (int y = 0; y <= n; ++y)
                for (int x = 1; x <= n; ++x)
                    book.vertices.position.push_back(
                        {x * std::cos(angle), double(y),
                         x * std::sin(angle) + 0.1 * noise(uint64_t(x), uint64_t(y))});
            for (int y = 0; y < n; ++y)
                for (int x = 0; x < n; ++x) {
                    book.triangles.push_back({at(x, y), at(x + 1, y), at(x + 1, y + 1)});
                    book.triangles.push_back({at(x, y), at(x + 1, y + 1), at(x, y + 1)});
                }
        }
        append(mesh, book, {100.0 * pages, 0, 0});
    }
    MemorySource strip;
    const int length = 120, width = 6;
    for (int i = 0; i < length; ++i)
        for (int j = 0; j <= width; ++j) {
            const double turn = 2 * std::numbers::pi * i / length;
            const double across = double(j) - width / 2.0;
            const double radius = 20 + across * std::cos(turn / 2);
            strip.vertices.position.push_back(
                {radius * std::cos(turn), radius * std::sin(turn), across * std::sin(turn / 2)});
        }
    const auto at = [&](int i, int j) {
        return i < length ? uint64_t(i * (width + 1) + j) : uint64_t(width - j);
    };
    for (int i = 0; i < length; ++i)
        for (int j = 0; j < width; ++j) {
            strip.triangles.push_back({at(i, j), at(i + 1, j), at(i + 1, j + 1)});
            strip.triangles.push_back({at(i, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    append(mesh, strip, {0, 0, 100});
    return mesh;
}

/// Triangles that are doubled, turned round and doubled, or without area, in a mesh of real size in
/// coordinates of millions.
inline MemorySource dirty() {
    MemorySource mesh;
    append(mesh, sheet(50, 0.3, [](int, int) { return false; }), {4.5e6, 5.2e6, 300});
    const size_t clean = mesh.triangles.size();
    for (size_t t = 0; t < clean; t += 97) {
        const auto [a, b, c] = mesh.triangles[t];
        mesh.triangles.push_back({a, b, c});
        if (t % 2 == 0) mesh.triangles.push_back({c, b, a});
        mesh.triangles.push_back({a, b, b});
    }
    return mesh;
}

inline ConformanceInput make(const std::string& name, std::function<MemorySource()> mesh) {
    return {name, [mesh] { return std::make_unique<MemorySource>(mesh()); }};
}

}  // namespace inputs

/// The first one is the plainest: closed, and large enough for several levels.
inline std::vector<ConformanceInput> conformanceInputs() {
    using namespace inputs;
    return {
        make("ball", [] { return ball(60, 0.2); }),
        make("sheet with holes",
             [] {
                 return sheet(120, 0.4, [](int x, int y) {
                     return (x / 10 + y / 10) % 7 == 3 || (x % 17 == 5 && y % 13 == 4);
                 });
             }),
        make("shuffled soup of squares",
             [] {
                 MemorySource mesh = sheet(60, 0.4, [](int x, int y) { return (x + y) % 2 == 1; });
                 mesh.shuffleTriangles();
                 return mesh;
             }),
        make("flat", [] { return sheet(80, 0, [](int x, int) { return x == 40; }); }),
        make("dust", dust),
        make("non-manifold", nonManifold),
        make("dirty", dirty),
        make("one triangle",
             [] {
                 return MemorySource({{0, 0, 0}, {1, 0, 0}, {0, 1, 0}}, {{0, 1, 2}});
             }),
    };
}

}  // namespace pietra
