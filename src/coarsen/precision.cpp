#include "coarsen/precision.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <mutex>

#include "base/parallel.h"
#include "coarsen/triangle_ahead.h"

namespace pietra {

namespace {

// Squared edge lengths by the leading bits of their floats: 32 bins an octave.
constexpr int kBinShift = 18;
constexpr size_t kBins = size_t(0x7f800000u >> kBinShift);

struct Statistics {
    std::vector<uint64_t> edges = std::vector<uint64_t>(kBins);
    // collapsing[s]: triangles with three corners on the finest lattice but not at shift s.
    std::array<uint64_t, kMaxLatticeShift + 1> collapsing{};
};

int32_t largestDifference(const Vec3i& a, const Vec3i& b) {
    const Vec3i d = glm::abs(a - b);
    return std::max({d.x, d.y, d.z});
}

void addTriangle(const std::array<Vec3i, 3>& p, Statistics& statistics) {
    int32_t shortest = std::numeric_limits<int32_t>::max();
    for (int k = 0; k < 3; ++k) {
        const Vec3i& a = p[size_t(k)];
        const Vec3i& b = p[size_t((k + 1) % 3)];
        shortest = std::min(shortest, largestDifference(a, b));
        const Vec3f d = Vec3f(a - b);
        ++statistics.edges[std::bit_cast<uint32_t>(glm::dot(d, d)) >> kBinShift];
    }
    if (shortest == 0) return;
    // Points that differ by 2^s or more in some coordinate stay apart at shift s.
    for (int s = std::bit_width(uint32_t(shortest)); s <= kMaxLatticeShift; ++s)
        for (int k = 0; k < 3; ++k)
            if (snapToShift(p[size_t(k)], s) == snapToShift(p[size_t((k + 1) % 3)], s)) {
                ++statistics.collapsing[size_t(s)];
                break;
            }
}

double medianEdge(const std::vector<uint64_t>& bins) {
    uint64_t total = 0;
    for (size_t b = 1; b < kBins; ++b) total += bins[b];
    uint64_t below = 0;
    for (size_t b = 1; b < kBins; ++b) {
        below += bins[b];
        if (2 * below >= total && total > 0)
            return std::sqrt(double(std::bit_cast<float>(uint32_t(b) << kBinShift)));
    }
    return 0;
}

}  // namespace

int chooseShift(TriangleSource& source, const VertexTable& vertices, size_t batch_triangles,
                Progress& progress) {
    progress.beginStage("measure edges", source.triangleCountHint());
    Statistics total;
    std::mutex mutex;
    std::vector<std::array<uint64_t, 3>> index;
    std::vector<std::byte> corners;
    TriangleAhead triangles(source, batch_triangles);
    while (triangles.next(index)) {
        vertices.gather(index, corners, true);
        parallelForSlices(index.size(), 65536, [&](size_t begin, size_t end) {
            Statistics part;
            for (size_t t = begin; t < end; ++t) {
                std::array<Vec3i, 3> p;
                for (size_t k = 0; k < 3; ++k)
                    p[k] = latticePoint(VertexRecord::key(corners.data() + (3 * t + k) * 8));
                addTriangle(p, part);
            }
            const std::lock_guard lock(mutex);
            for (size_t b = 0; b < kBins; ++b) total.edges[b] += part.edges[b];
            for (size_t s = 0; s < part.collapsing.size(); ++s)
                total.collapsing[s] += part.collapsing[s];
        });
        progress.tick(index.size());
    }
    const double limit = medianEdge(total.edges) / 50;
    int shift = 0;
    for (int s = 1; s <= kMaxLatticeShift; ++s) {
        const double error = std::sqrt(3.0) * (0.5 + double(1 << s) / 2);
        if (error > limit || total.collapsing[size_t(s)] > 0) break;
        shift = s;
    }
    return shift;
}

}  // namespace pietra
