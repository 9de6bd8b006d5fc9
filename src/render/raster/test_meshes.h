#pragma once
// Meshes for the tests and the benchmark of renderers. Lattice coordinates throughout: with the
// default Lattice{} these are also the input's.

#include <cmath>
#include <cstdint>
#include <functional>
#include <numbers>
#include <random>

#include "geometry/mesh.h"

namespace pietra::test_meshes {

/// Area-weighted vertex normals.
inline void computeNormals(Mesh& mesh) {
    std::vector<Vec3d> sum(mesh.vertexCount(), Vec3d(0, 0, 0));
    for (const Triangle& t : mesh.triangle) {
        const Vec3d a(mesh.position[t[0]]), b(mesh.position[t[1]]), c(mesh.position[t[2]]);
        for (const uint32_t v : t) sum[v] += glm::cross(b - a, c - a);
    }
    mesh.normal.clear();
    for (const Vec3d& n : sum)
        mesh.normal.push_back(encodeNormal(Vec3f(glm::length(n) > 0 ? glm::normalize(n) : n)));
    mesh.edge_class.assign(mesh.triangleCount(), 0);
}

/// A grid of columns x rows quads, two triangles each, in strips of at most `strip` columns so that
/// neighbours in the list are neighbours on the surface; point(u, v) for u, v in [0, 1].
inline Mesh grid(int columns, int rows, const std::function<Vec3d(double, double)>& point,
                 int strip = 16) {
    Mesh mesh;
    for (int j = 0; j <= rows; ++j)
        for (int i = 0; i <= columns; ++i)
            mesh.position.push_back(
                Vec3i(glm::round(point(double(i) / columns, double(j) / rows))));
    for (int begin = 0; begin < columns; begin += strip)
        for (int j = 0; j < rows; ++j)
            for (int i = begin; i < std::min(begin + strip, columns); ++i) {
                const auto v = uint32_t(j * (columns + 1) + i), up = v + uint32_t(columns) + 1;
                mesh.triangle.push_back({v, v + 1, up + 1});
                mesh.triangle.push_back({v, up + 1, up});
            }
    computeNormals(mesh);
    return mesh;
}

/// Closed: poles and seam are shared. Outward.
inline Mesh sphere(const Vec3d& centre, double radius, int around, int rings) {
    Mesh mesh;
    const auto at = [&](double theta, double phi) {
        return Vec3i(
            glm::round(centre + radius * Vec3d(std::sin(theta) * std::cos(phi),
                                               std::sin(theta) * std::sin(phi), std::cos(theta))));
    };
    mesh.position = {at(0, 0), at(std::numbers::pi, 0)};
    for (int r = 1; r < rings; ++r)
        for (int a = 0; a < around; ++a)
            mesh.position.push_back(
                at(std::numbers::pi * r / rings, 2 * std::numbers::pi * a / around));
    const auto vertex = [&](int r, int a) {
        return r == 0 ? 0u : r == rings ? 1u : uint32_t(2 + (r - 1) * around + a % around);
    };
    for (int r = 0; r < rings; ++r)
        for (int a = 0; a < around; ++a) {
            if (r + 1 < rings)
                mesh.triangle.push_back({vertex(r, a), vertex(r + 1, a), vertex(r + 1, a + 1)});
            if (r > 0)
                mesh.triangle.push_back({vertex(r, a), vertex(r + 1, a + 1), vertex(r, a + 1)});
        }
    computeNormals(mesh);
    return mesh;
}

/// Several octaves of sines over [0, size]^2, upward is +z.
inline Mesh terrain(int columns, int rows, double size, double height) {
    return grid(columns, rows, [&](double u, double v) {
        double z = 0, amplitude = 1, frequency = 3;
        for (int octave = 0; octave < 7; ++octave) {
            z += amplitude * std::sin(frequency * (u + 0.37 * v) + 1.7 * octave) *
                 std::cos(frequency * (v - 0.21 * u) + 0.6 * octave);
            amplitude *= 0.5;
            frequency *= 2.1;
        }
        return Vec3d(u * size, v * size, (z * 0.3 + 0.5) * height);
    });
}

/// The triangles from `begin` to `end` as a mesh of their own, with the vertices they use.
inline Mesh part(const Mesh& mesh, size_t begin, size_t end) {
    Mesh out;
    std::vector<uint32_t> number(mesh.vertexCount(), ~0u);
    for (size_t i = begin; i < end; ++i) {
        Triangle t = mesh.triangle[i];
        for (uint32_t& v : t) {
            if (number[v] == ~0u) {
                number[v] = uint32_t(out.vertexCount());
                out.position.push_back(mesh.position[v]);
                out.normal.push_back(mesh.normal[v]);
                if (!mesh.colour.empty()) out.colour.push_back(mesh.colour[v]);
            }
            v = number[v];
        }
        out.triangle.push_back(t);
        out.edge_class.push_back(mesh.edge_class.empty() ? 0 : mesh.edge_class[i]);
    }
    return out;
}

}  // namespace pietra::test_meshes
