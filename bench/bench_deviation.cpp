// Tightness and cost of the deviation bound on a real mesh: a hierarchy of patches whose borders
// shift from level to level, simplified by the plain simplifier of the tests.
//   bench_deviation MESH.{obj,ply} [levels=6] [keep=0.63] [patch=5000] [truth=1] [bits=21]
// A line a level: faces, microseconds a face of that step, and stated / true error over the
// patches.

#include <fmt/format.h>

#include <cstdio>
#include <numeric>

#include "clock.h"
#include "simplify/deviation_testing.h"

namespace {

using namespace pietra;
using namespace pietra::testing;

struct Patch {
    Mesh mesh;
    FaceBounds bounds;
    std::vector<uint8_t> locked;
    std::vector<uint32_t> global;  ///< vertex of the whole
    float child_error = 0;
};

/// The whole model at one level.
struct Level {
    Mesh mesh;
    FaceBounds bounds;
    std::vector<float> stated;  ///< per face: the error of its patch
    std::vector<uint32_t> patch;
    uint32_t patches = 0;
};

/// Median splits along axes that turn with the level.
std::vector<std::vector<uint32_t>> makePatches(const Mesh& mesh, size_t size, int level) {
    std::mt19937 random(level * 7919 + 1);
    std::normal_distribution<double> normal;
    std::uniform_real_distribution<double> where(0.4, 0.6);
    std::vector<std::vector<uint32_t>> done, open(1);
    open[0].resize(mesh.triangle.size());
    std::iota(open[0].begin(), open[0].end(), 0);
    while (!open.empty()) {
        std::vector<uint32_t> set = std::move(open.back());
        open.pop_back();
        if (set.size() <= size) {
            done.push_back(std::move(set));
            continue;
        }
        std::vector<double> key(mesh.triangle.size());
        Vec3d best(0);
        double widest = -1;
        for (int attempt = 0; attempt < 3; ++attempt) {
            const Vec3d axis =
                glm::normalize(Vec3d(normal(random), normal(random), normal(random)));
            double lo = 1e300, hi = -1e300;
            for (const uint32_t t : set) {
                const double x = glm::dot(axis, Vec3d(mesh.position[mesh.triangle[t][0]]));
                lo = std::min(lo, x);
                hi = std::max(hi, x);
            }
            if (hi - lo > widest) {
                widest = hi - lo;
                best = axis;
            }
        }
        for (const uint32_t t : set) {
            const Triangle& tri = mesh.triangle[t];
            key[t] = glm::dot(
                best, Vec3d(mesh.position[tri[0]] + mesh.position[tri[1]] + mesh.position[tri[2]]));
        }
        const size_t middle = size_t(double(set.size()) * where(random));
        std::nth_element(set.begin(), set.begin() + middle, set.end(),
                         [&](uint32_t a, uint32_t b) { return key[a] < key[b]; });
        open.emplace_back(set.begin(), set.begin() + middle);
        open.emplace_back(set.begin() + middle, set.end());
        for (auto* half : {&open.back(), &open[open.size() - 2]}) {
            std::sort(half->begin(), half->end());
        }
    }
    return done;
}

std::vector<Patch> cut(const Level& level, size_t size, int index) {
    const auto sets = makePatches(level.mesh, size, index);
    std::vector<uint32_t> owner(level.mesh.position.size(), kNoDeviationIndex);
    std::vector<uint8_t> shared(level.mesh.position.size(), 0);
    for (uint32_t p = 0; p < sets.size(); ++p) {
        for (const uint32_t t : sets[p]) {
            for (const uint32_t v : level.mesh.triangle[t]) {
                shared[v] |= owner[v] != kNoDeviationIndex && owner[v] != p;
                owner[v] = p;
            }
        }
    }
    std::vector<Patch> patches(sets.size());
    std::vector<uint32_t> local(level.mesh.position.size(), kNoDeviationIndex);
    for (uint32_t p = 0; p < sets.size(); ++p) {
        Patch& patch = patches[p];
        for (const uint32_t t : sets[p]) {
            Triangle tri = level.mesh.triangle[t];
            for (uint32_t& v : tri) {
                if (local[v] == kNoDeviationIndex) {
                    local[v] = uint32_t(patch.global.size());
                    patch.global.push_back(v);
                    patch.mesh.position.push_back(level.mesh.position[v]);
                    patch.locked.push_back(shared[v]);
                }
                v = local[v];
            }
            patch.mesh.triangle.push_back(tri);
            patch.bounds.to_original.push_back(level.bounds.to_original[t]);
            patch.bounds.from_original.push_back(level.bounds.from_original[t]);
            patch.child_error = std::max(patch.child_error, level.stated[t]);
        }
        for (const uint32_t v : patch.global) local[v] = kNoDeviationIndex;
    }
    return patches;
}

struct Step {
    Level level;
    std::vector<float> stated;  ///< a patch
    double seconds = 0;
};

Step step(const Level& level, size_t size, double keep, int index, Deviation& deviation) {
    std::vector<Patch> patches = cut(level, size, index);
    Step out;
    std::vector<uint32_t> global(level.mesh.position.size(), kNoDeviationIndex);
    for (uint32_t p = 0; p < patches.size(); ++p) {
        const Patch& patch = patches[p];
        PlainSimplifier simplifier(patch.mesh, patch.locked);
        const Simplified simple = simplifier.run(size_t(double(patch.mesh.triangle.size()) * keep));
        FaceBounds bounds;
        const double begin = threadSeconds();
        const float error =
            deviation.run({&patch.mesh, &patch.bounds, &simple.mesh, simple.vertex_map,
                           simple.triangle_map, simple.triangle_changed, patch.child_error},
                          bounds);
        out.seconds += threadSeconds() - begin;
        out.stated.push_back(error);
        // Vertices that are locked keep their place and are shared with other patches.
        std::vector<uint32_t> map(simple.mesh.position.size(), kNoDeviationIndex);
        for (uint32_t v = 0; v < patch.global.size(); ++v) {
            if (!patch.locked[v]) continue;
            uint32_t& g = global[patch.global[v]];
            if (g == kNoDeviationIndex) {
                g = uint32_t(out.level.mesh.position.size());
                out.level.mesh.position.push_back(patch.mesh.position[v]);
            }
            map[simple.vertex_map[v]] = g;
        }
        for (uint32_t v = 0; v < map.size(); ++v) {
            if (map[v] != kNoDeviationIndex) continue;
            map[v] = uint32_t(out.level.mesh.position.size());
            out.level.mesh.position.push_back(simple.mesh.position[v]);
        }
        for (uint32_t t = 0; t < simple.mesh.triangle.size(); ++t) {
            const Triangle& tri = simple.mesh.triangle[t];
            out.level.mesh.triangle.push_back({map[tri[0]], map[tri[1]], map[tri[2]]});
            out.level.bounds.to_original.push_back(bounds.to_original[t]);
            out.level.bounds.from_original.push_back(bounds.from_original[t]);
            out.level.stated.push_back(error);
            out.level.patch.push_back(p);
        }
    }
    out.level.patches = uint32_t(patches.size());
    return out;
}

/// Raises `e` to the largest distance of the triangle's points, by branch and bound down to
/// `spacing`.
void farthest(const DistanceOracle& oracle, const Vec3d& a, const Vec3d& b, const Vec3d& c,
              double spacing, double& e) {
    const Vec3d centre = (a + b + c) / 3.0;
    const double d = oracle.nearest(centre).distance;
    const double radius =
        std::max({glm::length(a - centre), glm::length(b - centre), glm::length(c - centre)});
    e = std::max(e, d);
    if (radius <= spacing || d + radius <= 1.01 * e) return;
    const Vec3d ab = 0.5 * (a + b), bc = 0.5 * (b + c), ca = 0.5 * (c + a);
    for (const Vec3d& p : {ab, bc, ca}) e = std::max(e, oracle.nearest(p).distance);
    farthest(oracle, a, ab, ca, spacing, e);
    farthest(oracle, b, bc, ab, spacing, e);
    farthest(oracle, c, ca, bc, spacing, e);
    farthest(oracle, ab, bc, ca, spacing, e);
}

/// The true two-sided error of each patch: original vertices to the nearest face, and points of the
/// faces to the original, the most promising faces first.
std::vector<double> truth(const Mesh& original, const DistanceOracle& oracle, double spacing,
                          const Level& level) {
    std::vector<double> error(level.patches, 0.0);
    const DistanceOracle coarse(level.mesh);
    for (const Vec3i& p : original.position) {
        const auto hit = coarse.nearest(Vec3d(p));
        double& e = error[level.patch[hit.triangle]];
        e = std::max(e, hit.distance);
    }
    std::vector<uint32_t> order(level.mesh.triangle.size());
    std::iota(order.begin(), order.end(), 0);
    const auto& b = level.bounds.from_original;
    std::sort(order.begin(), order.end(), [&](uint32_t x, uint32_t y) { return b[x] > b[y]; });
    for (const uint32_t t : order) {
        double& e = error[level.patch[t]];
        if (b[t] <= e) continue;
        const Triangle& tri = level.mesh.triangle[t];
        for (const uint32_t v : tri) {
            e = std::max(e, oracle.nearest(Vec3d(level.mesh.position[v])).distance);
        }
        farthest(oracle, Vec3d(level.mesh.position[tri[0]]), Vec3d(level.mesh.position[tri[1]]),
                 Vec3d(level.mesh.position[tri[2]]), spacing, e);
    }
    return error;
}

double quantile(std::vector<double> v, double q) {
    std::sort(v.begin(), v.end());
    return v.empty() ? 0 : v[std::min(v.size() - 1, size_t(q * double(v.size())))];
}

}  // namespace

int main(int argc, char** argv) {
    const auto number = [&](int i, double fallback) {
        return argc > i ? std::atof(argv[i]) : fallback;
    };
    if (argc < 2) return 2;
    const int levels = int(number(2, 6));
    const double keep = number(3, 0.63);
    const size_t size = size_t(number(4, 5000));
    const bool want_truth = number(5, 1) != 0;
    const Mesh original = readSimpleMesh(argv[1], int(number(6, 21)));
    if (original.triangle.empty()) return 3;
    Level level;
    level.mesh = original;
    level.bounds.to_original.assign(original.triangle.size(), 0);
    level.bounds.from_original = level.stated = level.bounds.to_original;
    double edge = 0;
    for (const Triangle& t : original.triangle) {
        edge += glm::length(Vec3d(original.position[t[0]] - original.position[t[1]]));
    }
    edge /= double(original.triangle.size());
    const DistanceOracle oracle(original);
    Deviation deviation;
    double total = 0;
    std::vector<double> all;
    fmt::print("level    faces patches us/face  median    p95    max    min  E/edge\n");
    for (int index = 1; index <= levels; ++index) {
        const size_t faces = level.mesh.triangle.size();
        Step s = step(level, size, keep, index, deviation);
        total += s.seconds;
        level = std::move(s.level);
        std::vector<double> ratio;
        if (want_truth) {
            const std::vector<double> exact = truth(original, oracle, 0.2 * edge, level);
            for (size_t p = 0; p < exact.size(); ++p) ratio.push_back(s.stated[p] / exact[p]);
            all.insert(all.end(), ratio.begin(), ratio.end());
        }
        fmt::print("{:5} {:8} {:7} {:7.3f} {:7.2f} {:6.2f} {:6.2f} {:6.3f} {:7.3f}\n", index, faces,
                   s.stated.size(), 1e6 * s.seconds / double(faces), quantile(ratio, 0.5),
                   quantile(ratio, 0.95), quantile(ratio, 1), quantile(ratio, 0),
                   quantile(std::vector<double>(s.stated.begin(), s.stated.end()), 0.5) / edge);
        std::fflush(stdout);
    }
    fmt::print("all: {:.3f} us an input triangle; ratio median {:.2f}, p95 {:.2f}\n",
               1e6 * total / double(original.triangle.size()), quantile(all, 0.5),
               quantile(all, 0.95));
    const Deviation::Counters& c = deviation.counters();
    fmt::print("faces {} general {} overlaps {} by overlap {} pieces {} verified {}\n", c.faces,
               c.general, c.overlaps, c.by_overlap, c.pieces, c.verified);
    return 0;
}
