#pragma once
// What the tests of progressive meshes share: meshes, and what must hold of any active mesh.

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <map>
#include <random>
#include <set>
#include <vector>

#include "io/memory_source.h"
#include "methods/pmesh/build.h"
#include "methods/pmesh/in_core_builder.h"
#include "methods/pmesh/split_view.h"
#include "simplify/test_meshes.h"

namespace pietra::pmesh {

struct TestMesh {
    const char* name;
    std::function<Mesh()> make;
};

/// `steps`: of the longest side of the box.
inline Mesh onLattice(const test::Shape& shape, int32_t steps) {
    return test::toLattice(shape, steps);
}

/// Two spheres that share one vertex.
inline test::Shape bowTie() {
    test::Shape shape = test::sphereShape(6), other = test::sphereShape(6);
    const uint32_t first = uint32_t(shape.position.size());
    const Vec3d move = shape.position[0] * 2.0;  // its antipode's mirror image touches there
    for (const Vec3d& p : other.position) shape.position.push_back(move - p);
    for (const Triangle& t : other.triangle)
        shape.triangle.push_back({first + t[0], first + t[2], first + t[1]});
    return shape;
}

inline test::Shape dented(test::Shape shape, double amplitude) {
    std::mt19937 random(7);
    std::normal_distribution<double> noise(0, amplitude);
    // Shapes may have several vertices at one place, which must stay together.
    std::map<std::array<int64_t, 3>, Vec3d> moved;
    for (Vec3d& p : shape.position) {
        const auto key = [](double x) { return std::llround(x * 1e9); };
        const auto [it, is_new] = moved.try_emplace({key(p.x), key(p.y), key(p.z)});
        if (is_new) it->second = p + Vec3d(noise(random), noise(random), noise(random));
        p = it->second;
    }
    return shape;
}

inline std::vector<TestMesh> testMeshes() {
    using namespace test;
    return {
        {"ball", [] { return onLattice(dented(sphereShape(16), 0.01), 900); }},
        {"fine_ball", [] { return onLattice(dented(sphereShape(16), 0.01), 1 << 20); }},
        {"bordered", [] { return onLattice(gridShape(40, 0.1), 1200); }},
        {"non_manifold", [] { return onLattice(bookShape(16), 1000); }},
        {"bow_tie", [] { return onLattice(bowTie(), 900); }},
        {"dust", [] { return onLattice(dustShape(60, 0.05, 3), 2000); }},
        {"soup", [] { return onLattice(soupShape(200, 0.05, 3), 2000); }},
    };
}

/// Positions are the lattice.
inline MemorySource sourceOf(const Mesh& mesh) {
    std::vector<Vec3d> positions;
    for (const Vec3i& p : mesh.position) positions.push_back(Vec3d(p));
    std::vector<MemorySource::Index> triangles;
    for (const Triangle& t : mesh.triangle) triangles.push_back({t[0], t[1], t[2]});
    return MemorySource(positions, triangles);
}

inline BuildSettings smallDiamonds(uint32_t leaf_triangles, const std::string& path) {
    BuildSettings settings;
    settings.output = path;
    settings.force = true;
    settings.memory_bytes = size_t(256) << 20;
    settings.jobs = 2;
    settings.temp_dir = ::testing::TempDir();
    settings.leaf_triangles = leaf_triangles;
    settings.patch_triangles = leaf_triangles;
    settings.precision = {PrecisionSetting::Kind::kStep, 1.0};
    return settings;
}

inline SplitView randomView(std::mt19937& random, const SplitForest& forest) {
    const NestedCriterion& c = forest.row.front().criterion;
    const Vec3d size(c.max[0], c.max[1], c.max[2]);
    std::uniform_real_distribution<float> place(-0.5f, 1.5f), power(-3, 12);
    std::normal_distribution<float> any;
    SplitView view;
    for (int k = 0; k < 3; ++k) view.eye[size_t(k)] = place(random) * float(size[k]);
    view.reach = std::exp2(power(random));
    view.hides_backs = random() % 3 == 0;
    if (random() % 2 == 0) return view;
    for (size_t i = 0; i < 4; ++i) {
        const Vec3f n = glm::normalize(Vec3f(any(random), any(random), any(random)));
        for (int k = 0; k < 3; ++k) {
            view.side[i][size_t(k)] = n[k];
            view.at_eye[i] += n[k] * view.eye[size_t(k)];
        }
    }
    return view;
}

/// By diamonds, into a file.
inline BuildReport buildFile(const Mesh& mesh, uint32_t leaf_triangles, const std::string& path) {
    MemorySource source = sourceOf(mesh);
    Progress progress;
    return build(source, smallDiamonds(leaf_triangles, path), progress);
}

}  // namespace pietra::pmesh
