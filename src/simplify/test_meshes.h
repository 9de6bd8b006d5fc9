#pragma once
// Meshes for the tests and benchmarks of this folder: synthetic shapes, real scans where the shared
// data is there, and pieces cut from them the way diamonds are.

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <map>
#include <random>
#include <sstream>
#include <string>
#include <unordered_map>
#include <vector>

#include "geometry/lattice.h"
#include "geometry/mesh.h"

namespace pietra::test {

/// A triangle soup with shared indices, in doubles, before it goes to the lattice.
struct Shape {
    std::vector<Vec3d> position;
    std::vector<Triangle> triangle;
};

inline std::pair<uint32_t, uint32_t> edgeOf(uint32_t a, uint32_t b) {
    return {std::min(a, b), std::max(a, b)};
}

/// How often each undirected edge is used.
inline std::map<std::pair<uint32_t, uint32_t>, int> edgeUses(
    const std::vector<Triangle>& triangles) {
    std::map<std::pair<uint32_t, uint32_t>, int> uses;
    for (const Triangle& t : triangles)
        for (int k = 0; k < 3; ++k) ++uses[edgeOf(t[k], t[(k + 1) % 3])];
    return uses;
}

inline EdgeClass classOfUses(int uses) {
    return uses == 1   ? EdgeClass::kBorder
           : uses == 2 ? EdgeClass::kManifold
           : uses == 3 ? EdgeClass::kTriple
                       : EdgeClass::kMany;
}

/// Edge classes as if the mesh were the whole model.
inline void classifyEdges(Mesh& mesh) {
    struct Hash {
        size_t operator()(uint64_t key) const { return size_t(key * 0x9e3779b97f4a7c15ULL >> 20); }
    };
    std::unordered_map<uint64_t, int, Hash> uses(mesh.triangleCount() * 2);
    const auto key = [](uint32_t a, uint32_t b) {
        const auto [low, high] = edgeOf(a, b);
        return uint64_t(low) << 32 | high;
    };
    for (const Triangle& t : mesh.triangle)
        for (int k = 0; k < 3; ++k) ++uses[key(t[k], t[(k + 1) % 3])];
    mesh.edge_class.clear();
    for (const Triangle& t : mesh.triangle) {
        uint32_t bits = 0;
        for (int k = 0; k < 3; ++k)
            bits |= uint32_t(classOfUses(uses[key(t[k], t[(k + 1) % 3])])) << (2 * k);
        mesh.edge_class.push_back(uint8_t(bits));
    }
}

inline void computeNormals(Mesh& mesh) {
    std::vector<Vec3d> sum(mesh.vertexCount(), Vec3d(0));
    for (const Triangle& t : mesh.triangle) {
        const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
        for (const uint32_t v : t) sum[v] += glm::cross(b - a, c - a);
    }
    mesh.normal.clear();
    for (const Vec3d& n : sum) {
        const double length = glm::length(n);
        mesh.normal.push_back(encodeNormal(length > 0 ? Vec3f(n / length) : Vec3f(0, 0, 1)));
    }
}

/// On the lattice, the longest side of its box `extent` units long; equal positions are welded,
/// degenerate and doubled triangles dropped; unused vertices too.
inline Mesh toLattice(const Shape& shape, int32_t extent) {
    Vec3d low(1e300), high(-1e300);
    for (const Vec3d& p : shape.position) low = glm::min(low, p), high = glm::max(high, p);
    const Vec3d size = high - low;
    const double scale = extent / std::max(size.x, std::max(size.y, size.z));
    Mesh mesh;
    std::unordered_map<uint64_t, uint32_t> at;
    std::vector<uint32_t> remap(shape.position.size(), 0xffffffffu);
    std::map<std::array<uint32_t, 3>, int> seen;
    for (const Triangle& t : shape.triangle) {
        Triangle r;
        std::array<Vec3i, 3> p;
        for (int k = 0; k < 3; ++k)
            p[k] = Vec3i(glm::floor((shape.position[t[k]] - low) * scale + 0.5)) + Vec3i(1000);
        if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) continue;
        for (int k = 0; k < 3; ++k) {
            const auto [it, added] =
                at.try_emplace(latticeKey(p[k]), uint32_t(mesh.position.size()));
            if (added) mesh.position.push_back(p[k]);
            r[k] = it->second;
        }
        std::array<uint32_t, 3> sorted = r;
        std::sort(sorted.begin(), sorted.end());
        if (!seen.try_emplace(sorted, 1).second) continue;
        mesh.triangle.push_back(r);
    }
    classifyEdges(mesh);
    computeNormals(mesh);
    return mesh;
}

/// A cube's faces subdivided n times a side and blown up to the unit sphere: 12 n^2 triangles.
inline Shape sphereShape(int n) {
    Shape s;
    for (int axis = 0; axis < 3; ++axis)
        for (int side = -1; side <= 1; side += 2) {
            const uint32_t first = uint32_t(s.position.size());
            for (int j = 0; j <= n; ++j)
                for (int i = 0; i <= n; ++i) {
                    Vec3d p;
                    p[axis] = side;
                    p[(axis + 1) % 3] = std::tan((2.0 * i / n - 1) * 0.7853981633974483);
                    p[(axis + 2) % 3] = std::tan((2.0 * j / n - 1) * 0.7853981633974483);
                    s.position.push_back(glm::normalize(p));
                }
            for (int j = 0; j < n; ++j)
                for (int i = 0; i < n; ++i) {
                    const uint32_t a = first + uint32_t(j * (n + 1) + i), b = a + 1,
                                   c = a + uint32_t(n) + 1, d = c + 1;
                    if (side > 0) {
                        s.triangle.push_back({a, b, d});
                        s.triangle.push_back({a, d, c});
                    } else {
                        s.triangle.push_back({a, d, b});
                        s.triangle.push_back({a, c, d});
                    }
                }
        }
    return s;
}

/// A wavy square of 2 n^2 triangles with an open border; `amplitude` 0: flat.
inline Shape gridShape(int n, double amplitude) {
    Shape s;
    for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i)
            s.position.push_back({double(i) / n, double(j) / n,
                                  amplitude * std::sin(7.0 * i / n) * std::cos(9.0 * j / n)});
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            const uint32_t a = uint32_t(j * (n + 1) + i), b = a + 1, c = a + uint32_t(n) + 1,
                           d = c + 1;
            s.triangle.push_back({a, b, d});
            s.triangle.push_back({a, d, c});
        }
    return s;
}

/// Three pages of n x n squares that meet along the z axis.
inline Shape bookShape(int n) {
    Shape s;
    for (int page = 0; page < 3; ++page) {
        const double angle = page * 2.0943951023931953;
        const uint32_t first = uint32_t(s.position.size());
        for (int j = 0; j <= n; ++j)
            for (int i = 0; i <= n; ++i)
                s.position.push_back(
                    {std::cos(angle) * i / n, std::sin(angle) * i / n, double(j) / n});
        for (int j = 0; j < n; ++j)
            for (int i = 0; i < n; ++i) {
                const uint32_t a = first + uint32_t(j * (n + 1) + i), b = a + 1,
                               c = a + uint32_t(n) + 1, d = c + 1;
                s.triangle.push_back({a, b, d});
                s.triangle.push_back({a, d, c});
            }
    }
    return s;
}

/// `count` closed tetrahedra of edge about `size`, scattered over the unit cube.
inline Shape dustShape(int count, double size, unsigned seed) {
    Shape s;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    for (int i = 0; i < count; ++i) {
        const uint32_t a = uint32_t(s.position.size());
        const Vec3d c(unit(random), unit(random), unit(random));
        const double r = size * (0.5 + unit(random));
        s.position.insert(s.position.end(), {c + r * Vec3d(1, 1, 1), c + r * Vec3d(1, -1, -1),
                                             c + r * Vec3d(-1, 1, -1), c + r * Vec3d(-1, -1, 1)});
        s.triangle.insert(s.triangle.end(),
                          {Triangle{a, a + 1, a + 2}, Triangle{a, a + 3, a + 1},
                           Triangle{a, a + 2, a + 3}, Triangle{a + 1, a + 3, a + 2}});
    }
    return s;
}

/// `count` unconnected triangles.
inline Shape soupShape(int count, double size, unsigned seed) {
    Shape s;
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0, 1);
    const auto point = [&] { return Vec3d(unit(random), unit(random), unit(random)); };
    for (int i = 0; i < count; ++i) {
        const uint32_t a = uint32_t(s.position.size());
        const Vec3d c = point();
        for (int k = 0; k < 3; ++k) s.position.push_back(c + size * point());
        s.triangle.push_back({a, a + 1, a + 2});
    }
    return s;
}

/// The folder of shared test data, or empty.
inline std::filesystem::path sharedFolder() {
    if (const char* given = std::getenv("PIETRA_SHARED")) return given;
    for (std::filesystem::path p = __FILE__; p.has_relative_path(); p = p.parent_path())
        if (std::filesystem::exists(p / "shared" / "data")) return p / "shared";
    return {};
}

/// Vertices and triangles of an ascii OBJ ("v", "f" with plain or slashed indices); empty if
/// absent.
inline Shape readObj(const std::filesystem::path& path) {
    Shape s;
    std::ifstream in(path);
    std::string line;
    while (std::getline(in, line)) {
        std::istringstream words(line);
        std::string kind;
        words >> kind;
        if (kind == "v") {
            Vec3d p;
            words >> p.x >> p.y >> p.z;
            s.position.push_back(p);
        } else if (kind == "f") {
            std::vector<uint32_t> polygon;
            for (std::string word; words >> word;)
                polygon.push_back(uint32_t(std::stoul(word)) - 1);
            for (size_t i = 2; i < polygon.size(); ++i)
                s.triangle.push_back({polygon[0], polygon[i - 1], polygon[i]});
        }
    }
    return s;
}

inline Shape readScan(const char* name) {
    const std::filesystem::path folder = sharedFolder();
    return folder.empty() ? Shape{} : readObj(folder / "data" / "scans" / name);
}

/// The part of `mesh` made of the triangles with keep(index); classes stay those of the whole.
template <class Keep>
Mesh extract(const Mesh& mesh, const Keep& keep) {
    Mesh part;
    std::vector<uint32_t> remap(mesh.vertexCount(), 0xffffffffu);
    for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
        if (!keep(t)) continue;
        Triangle r;
        for (int k = 0; k < 3; ++k) {
            uint32_t& to = remap[mesh.triangle[t][k]];
            if (to == 0xffffffffu) {
                to = uint32_t(part.position.size());
                part.position.push_back(mesh.position[mesh.triangle[t][k]]);
                part.normal.push_back(mesh.normal[mesh.triangle[t][k]]);
                if (!mesh.colour.empty()) part.colour.push_back(mesh.colour[mesh.triangle[t][k]]);
            }
            r[k] = to;
        }
        part.triangle.push_back(r);
        part.edge_class.push_back(mesh.edge_class[t]);
    }
    return part;
}

/// Back again, welded.
inline Shape shapeOf(const Mesh& mesh) {
    Shape s;
    for (const Vec3i& p : mesh.position) s.position.push_back(Vec3d(p));
    s.triangle = mesh.triangle;
    return s;
}

/// Every triangle in four, the new vertices displaced by hashed noise of several octaves, which
/// makes it simplify like a scan and not like a smooth surface. `amplitude` in mean edges of the
/// result.
inline Shape subdivide(const Shape& in, double amplitude, unsigned seed) {
    Shape out;
    out.position = in.position;
    std::unordered_map<uint64_t, uint32_t> middle;
    std::mt19937_64 random(seed);
    std::normal_distribution<double> noise;
    const auto split = [&](uint32_t a, uint32_t b) {
        const auto [low, high] = edgeOf(a, b);
        const auto [it, added] =
            middle.try_emplace(uint64_t(low) << 32 | high, uint32_t(out.position.size()));
        if (added) {
            const Vec3d d = in.position[b] - in.position[a];
            const Vec3d jitter(noise(random), noise(random), noise(random));
            out.position.push_back((in.position[a] + in.position[b]) * 0.5 +
                                   jitter * (amplitude * 0.5 * glm::length(d)));
        }
        return it->second;
    };
    for (const Triangle& t : in.triangle) {
        const uint32_t m0 = split(t[0], t[1]), m1 = split(t[1], t[2]), m2 = split(t[2], t[0]);
        out.triangle.push_back({t[0], m0, m2});
        out.triangle.push_back({m0, t[1], m1});
        out.triangle.push_back({m2, m1, t[2]});
        out.triangle.push_back({m0, m1, m2});
    }
    return out;
}

}  // namespace pietra::test
