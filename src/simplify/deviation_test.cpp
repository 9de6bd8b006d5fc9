#include "simplify/deviation.h"

#include <gtest/gtest.h>

#include <numeric>

#include "simplify/deviation_partition.h"
#include "simplify/deviation_testing.h"

namespace pietra {
namespace {

using namespace testing;

/// A mesh of some level, with bounds that hold against `original`.
struct Bounded {
    Mesh mesh;
    FaceBounds bounds;
    float error = 0;
};

Bounded exactly(const Mesh& mesh) {
    const std::vector<float> zero(mesh.triangle.size(), 0.0f);
    return {mesh, {zero, zero}, 0};
}

Bounded deviate(const Bounded& before, const Simplified& step) {
    Bounded after{step.mesh, {}, 0};
    Deviation deviation;
    after.error = deviation.run({&before.mesh, &before.bounds, &step.mesh, step.vertex_map,
                                 step.triangle_map, step.triangle_changed, before.error},
                                after.bounds);
    return after;
}

Simplified simplify(const Mesh& mesh, double keep) {
    return PlainSimplifier(mesh, {}).run(size_t(keep * double(mesh.triangle.size())));
}

double meanEdge(const Mesh& mesh) {
    double sum = 0;
    for (const Triangle& t : mesh.triangle) {
        sum += glm::length(Vec3d(mesh.position[t[0]] - mesh.position[t[1]]));
    }
    return sum / double(mesh.triangle.size());
}

/// How far the bounds are violated, as seen by dense sampling: the largest of
/// true distance - bound, over both directions. Not positive if the bounds hold.
struct Violation {
    double to_original = -1e300, from_original = -1e300;
    double truth = 0;  ///< the largest distance met
    double worst() const { return std::max(to_original, from_original); }
};

/// A is checked as "x has a face f within to_original[f]", which is what it promises.
Violation violation(const Mesh& original, const Mesh& mesh, const FaceBounds& bounds,
                    double spacing) {
    Violation v;
    const DistanceOracle to_mesh(mesh), to_original(original);
    samplePoints(original, spacing, [&](const Vec3d& x, uint32_t) {
        const auto hit = to_mesh.nearest(x);
        v.truth = std::max(v.truth, hit.distance);
        double excess = hit.distance - double(bounds.to_original[hit.triangle]);
        if (excess > v.to_original) {  // some other face may answer for x
            for (uint32_t t = 0; t < mesh.triangle.size() && excess > 0; ++t) {
                const Triangle& tri = mesh.triangle[t];
                const double d = DistanceOracle::distance(x, Vec3d(mesh.position[tri[0]]),
                                                          Vec3d(mesh.position[tri[1]]),
                                                          Vec3d(mesh.position[tri[2]]));
                excess = std::min(excess, d - double(bounds.to_original[t]));
            }
            v.to_original = std::max(v.to_original, excess);
        }
    });
    samplePoints(mesh, spacing, [&](const Vec3d& y, uint32_t t) {
        const double d = to_original.nearest(y).distance;
        v.truth = std::max(v.truth, d);
        v.from_original = std::max(v.from_original, d - double(bounds.from_original[t]));
    });
    return v;
}

/// What the sample points themselves are off by: doubles below 2^21.
constexpr double kSampleRounding = 0x1p-30;

void expectBound(const Mesh& original, const Bounded& result, double spacing) {
    const Violation v = violation(original, result.mesh, result.bounds, spacing);
    EXPECT_LE(v.to_original, kSampleRounding);
    EXPECT_LE(v.from_original, kSampleRounding);
    EXPECT_LE(v.truth, double(result.error) + kSampleRounding);
    for (const float a : result.bounds.to_original) EXPECT_LE(a, result.error);
    for (const float b : result.bounds.from_original) EXPECT_LE(b, result.error);
}

Mesh roughSphere(int levels, double size, double roughness, uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-1, 1);
    return bumpySphere(levels, [&](const Vec3d& p) {
        return size * (1 + 0.1 * std::sin(5 * p.x) * std::cos(4 * p.y) + roughness * noise(random));
    });
}

Mesh roughField(int n, double amplitude, uint32_t seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> noise(-1, 1);
    return heightField(n, 64, [&](int x, int y) {
        return amplitude * (std::sin(0.3 * x) * std::cos(0.2 * y) + 0.1 * noise(random));
    });
}

TEST(Deviation, HoldsOnRandomMeshesOverLevels) {
    for (uint32_t seed = 1; seed <= 4; ++seed) {
        const Mesh original = seed % 2 ? roughSphere(4, 3000.0 * seed, 0.003 * seed, seed)
                                       : roughField(24, 40.0 * seed, seed);
        Bounded level = exactly(original);
        for (int i = 0; i < 4; ++i) {
            SCOPED_TRACE(::testing::Message() << "seed " << seed << " level " << i + 1);
            level = deviate(level, simplify(level.mesh, 0.6));
            expectBound(original, level, 0.4 * meanEdge(original));
        }
    }
}

TEST(Deviation, HalvingABoundIsSeen) {
    const Mesh original = roughSphere(4, 4000, 0.005, 7);
    Bounded level = deviate(exactly(original), simplify(original, 0.5));
    const double spacing = 0.25 * meanEdge(original);
    EXPECT_LE(violation(original, level.mesh, level.bounds, spacing).worst(), kSampleRounding);
    FaceBounds halved = level.bounds;
    for (float& b : halved.from_original) b /= 2;
    EXPECT_GT(violation(original, level.mesh, halved, spacing).from_original, 0);
    halved = level.bounds;
    for (float& a : halved.to_original) a /= 2;
    EXPECT_GT(violation(original, level.mesh, halved, spacing).to_original, 0);
}

TEST(Deviation, NonsensicalMapsLoosenNothingButTime) {
    const Mesh original = roughField(16, 60, 3);
    const Simplified good = simplify(original, 0.5);
    const Bounded reference = deviate(exactly(original), good);
    std::mt19937 random(5);
    for (int kind = 0; kind < 4; ++kind) {
        SCOPED_TRACE(kind);
        Simplified bad = good;
        const uint32_t vertices = uint32_t(good.mesh.position.size());
        const uint32_t triangles = uint32_t(good.mesh.triangle.size());
        for (uint32_t& v : bad.vertex_map) {
            v = kind == 0 ? kNoDeviationIndex : kind == 1 ? 0 : uint32_t(random()) % (2 * vertices);
        }
        for (uint32_t& t : bad.triangle_map) {
            t = kind == 0   ? kNoDeviationIndex
                : kind == 1 ? 0
                            : uint32_t(random()) % (2 * triangles);
        }
        if (kind == 3) {
            bad.vertex_map.resize(5);
            bad.triangle_map.resize(7);
        }
        std::fill(bad.triangle_changed.begin(), bad.triangle_changed.end(), uint8_t(kind % 2));
        const Bounded level = deviate(exactly(original), bad);
        expectBound(original, level, 16);
    }
}

TEST(Deviation, UnchangedMeshKeepsItsBounds) {
    const Mesh mesh = roughField(8, 30, 1);
    Simplified same{mesh, {}, {}, std::vector<uint8_t>(mesh.triangle.size(), 0)};
    for (uint32_t v = 0; v < mesh.position.size(); ++v) same.vertex_map.push_back(v);
    for (uint32_t t = 0; t < mesh.triangle.size(); ++t) same.triangle_map.push_back(t);
    Bounded before = exactly(mesh);
    for (size_t t = 0; t < mesh.triangle.size(); ++t) {
        before.bounds.to_original[t] = float(t % 7) + 0.1f;
        before.bounds.from_original[t] = float(t % 5) + 0.2f;
    }
    const Bounded after = deviate(before, same);
    EXPECT_EQ(after.bounds.to_original, before.bounds.to_original);
    EXPECT_EQ(after.bounds.from_original, before.bounds.from_original);
    EXPECT_EQ(after.error, 6.1f);
}

TEST(Deviation, ThinWalls) {
    Mesh original = roughField(16, 30, 2);
    Mesh back = original;
    for (Triangle& t : back.triangle) std::swap(t[1], t[2]);
    append(original, back, {0, 0, 20});
    Bounded level = exactly(original);
    for (int i = 0; i < 3; ++i) {
        level = deviate(level, simplify(level.mesh, 0.6));
        expectBound(original, level, 20);
    }
}

TEST(Deviation, DroppedComponentIsCounted) {
    Mesh original = roughField(12, 30, 2);
    const Mesh kept = original;
    append(original, bumpySphere(1, [](const Vec3d&) { return 50.0; }),
           {-(1 << 20) + 1400, -(1 << 20) + 1400, -(1 << 20) + 500200});
    Simplified step{kept, {}, {}, std::vector<uint8_t>(kept.triangle.size(), 0)};
    for (uint32_t v = 0; v < original.position.size(); ++v) {
        step.vertex_map.push_back(v < kept.position.size() ? v : kNoDeviationIndex);
    }
    for (uint32_t t = 0; t < original.triangle.size(); ++t) {
        step.triangle_map.push_back(t < kept.triangle.size() ? t : kNoDeviationIndex);
    }
    const Bounded level = deviate(exactly(original), step);
    expectBound(original, level, 10);
    EXPECT_GT(level.error, 150);
    EXPECT_LT(level.error, 400);
    for (const float b : level.bounds.from_original) EXPECT_EQ(b, 0);
}

TEST(Deviation, VertexClustering) {
    const Mesh original = roughSphere(4, 2000, 0.01, 9);
    Simplified step;
    std::map<std::array<int, 3>, uint32_t> cell;
    std::map<std::array<uint32_t, 3>, uint32_t> seen;
    for (const Vec3i& p : original.position) {
        const auto [it, added] = cell.try_emplace({p.x / 400, p.y / 400, p.z / 400},
                                                  uint32_t(step.mesh.position.size()));
        if (added) step.mesh.position.push_back(p);
        step.vertex_map.push_back(it->second);
    }
    for (const Triangle& t : original.triangle) {
        Triangle m{step.vertex_map[t[0]], step.vertex_map[t[1]], step.vertex_map[t[2]]};
        step.triangle_map.push_back(kNoDeviationIndex);
        if (m[0] == m[1] || m[1] == m[2] || m[2] == m[0]) continue;
        std::array<uint32_t, 3> key = m;
        std::sort(key.begin(), key.end());
        if (!seen.try_emplace(key, 0).second) continue;
        step.triangle_map.back() = uint32_t(step.mesh.triangle.size());
        step.mesh.triangle.push_back(m);
    }
    step.triangle_changed.assign(step.mesh.triangle.size(), 1);
    expectBound(original, deviate(exactly(original), step), 0.5 * meanEdge(original));
}

TEST(Deviation, DegenerateFacesAndSingleTriangles) {
    Mesh one;
    one.position = {{0, 0, 0}, {1000, 0, 0}, {0, 1000, 0}};
    one.triangle = {{0, 1, 2}};
    Mesh point = one, segment = one, far = one;
    point.position = {{5, 5, 5}, {5, 5, 5}, {5, 5, 5}};
    segment.position = {{0, 0, 0}, {500, 0, 10}, {1000, 0, 20}};
    far.position = {{2000000, 2000000, 0}, {2000000, 2000000, 900}, {2000000, 2001000, 0}};
    for (const Mesh& before : {one, point, segment, far}) {
        for (const Mesh& after : {one, point, segment, far}) {
            const Simplified step{after, {0, 1, 2}, {0}, {1}};
            expectBound(before, deviate(exactly(before), step), 50);
        }
    }
}

TEST(Deviation, NonManifoldAndInconsistentWinding) {
    Mesh original = roughField(10, 40, 4);
    std::mt19937 random(1);
    const size_t count = original.triangle.size();
    for (size_t i = 0; i < count / 4; ++i) {
        Triangle t = original.triangle[random() % count];
        if (i % 2) std::swap(t[0], t[1]);
        if (i % 3 == 0) t[2] = uint32_t(random() % original.position.size());
        if (t[2] != t[0] && t[2] != t[1]) original.triangle.push_back(t);
    }
    Bounded level = exactly(original);
    for (int i = 0; i < 2; ++i) {
        level = deviate(level, simplify(level.mesh, 0.7));
        expectBound(original, level, 15);
    }
}

TEST(Deviation, SameResultEveryTime) {
    const Mesh original = roughSphere(4, 4000, 0.005, 11);
    const Simplified step = simplify(original, 0.5);
    Deviation deviation;
    FaceBounds first, second;
    const Bounded before = exactly(original);
    const DeviationInput input{
        &before.mesh,      &before.bounds,        &step.mesh, step.vertex_map,
        step.triangle_map, step.triangle_changed, 0};
    const float error = deviation.run(input, first);
    const Bounded other = exactly(roughField(6, 20, 1));
    const Simplified other_step = simplify(other.mesh, 0.5);
    deviation.run({&other.mesh, &other.bounds, &other_step.mesh, other_step.vertex_map,
                   other_step.triangle_map, other_step.triangle_changed, 0},
                  second);
    EXPECT_EQ(deviation.run(input, second), error);
    EXPECT_EQ(first.to_original, second.to_original);
    EXPECT_EQ(first.from_original, second.from_original);
}

// Faces of the original are offered beside the new ones; they would take everything.
TEST(Deviation, GivesUpFacesNotWorthIt) {
    const Mesh original = roughSphere(4, 4000, 0.005, 13);
    const Bounded before = exactly(original);
    const Simplified step = simplify(original, 0.3);
    Bounded after{step.mesh, {}, 0};
    const uint32_t own = uint32_t(step.mesh.triangle.size());
    const uint32_t base = uint32_t(step.mesh.position.size());
    for (const Vec3i& p : original.position) after.mesh.position.push_back(p);
    for (const Triangle& t : original.triangle)
        after.mesh.triangle.push_back({t[0] + base, t[1] + base, t[2] + base});
    DeviationInput in{&before.mesh, &before.bounds, &after.mesh, {}, {}, {}, 0};
    in.after_takes = uint32_t(original.triangle.size());
    const auto sumOfOwn = [&](uint32_t keep_one_of) {
        in.worth = [=](uint32_t f, float, float) { return (f - own) % keep_one_of == 0; };
        after.error = Deviation().run(in, after.bounds);
        for (uint32_t f = own; f < after.mesh.triangle.size(); ++f)
            EXPECT_TRUE(in.worth(f, 0, 0) || after.bounds.to_original[f] < 0);
        expectBound(original, after, 0.4 * meanEdge(original));
        const auto& value = after.bounds.to_original;
        return std::accumulate(value.begin(), value.begin() + own, 0.0f);
    };
    const float all = sumOfOwn(1), half = sumOfOwn(2), none = sumOfOwn(~0u);
    EXPECT_EQ(all, 0);
    EXPECT_GT(half, 0);
    EXPECT_GT(none, half);
}

TEST(Deviation, FourCornersAtOnceAreAsFarAsEachAlone) {
    std::mt19937 random(17);
    const auto point = [&](int size) {
        const auto coordinate = [&] { return float(int(random() % (2 * size)) - size); };
        return Vec3f(coordinate(), coordinate(), coordinate()) * 0.25f;
    };
    for (int trial = 0; trial < 20000; ++trial) {
        const int size = 2 << trial % 20;
        deviation::Polygon polygon;
        while (polygon.count < 3 + trial % 6) polygon.add(point(size));
        LocalTriangle t{point(size), point(size), point(size), Vec3f(0)};
        if (trial % 7 == 0) t.c = t.b;
        if (trial % 49 == 0) t.a = t.b;
        const Vec3f normal = glm::cross(t.b - t.a, t.c - t.a);
        if (trial % 7 && normal != Vec3f(0)) t.normal = glm::normalize(normal);
        const Vec3f& far = polygon.corner[deviation::farthestCorner(polygon, t)];
        EXPECT_EQ(deviation::maxCornerDistance(polygon, t),
                  std::sqrt(squaredDistance(far, t)) + deviation::distanceSlack(polygon, t));
    }
}

TEST(Deviation, RefusesEmptyMeshes) {
    const Mesh mesh = roughField(2, 5, 1);
    const Bounded before = exactly(mesh);
    const Mesh empty;
    FaceBounds bounds;
    Deviation deviation;
    EXPECT_ANY_THROW(deviation.run({&before.mesh, &before.bounds, &empty, {}, {}, {}, 0}, bounds));
}

TEST(Deviation, HoldsOnARealMesh) {
    const auto data = sharedData();
    if (data.empty()) GTEST_SKIP() << "no shared data: set PIETRA_SHARED";
    const Mesh original = readSimpleMesh(data / "scans/armadillo_86k.obj", 17);
    ASSERT_FALSE(original.triangle.empty());
    // A slice of the model: the faces of a box about its middle.
    Mesh slice;
    slice.position = original.position;
    for (const Triangle& t : original.triangle) {
        if (original.position[t[0]].y > 95000) slice.triangle.push_back(t);
    }
    Bounded level = exactly(slice);
    for (int i = 0; i < 2; ++i) {
        level = deviate(level, simplify(level.mesh, 0.63));
        expectBound(slice, level, 0.7 * meanEdge(slice));
    }
}

}  // namespace
}  // namespace pietra
