#include "audit/sample_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <tuple>

#include "base/check.h"
#include "base/parallel.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"

namespace pietra {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Bits of a 21-bit number, two apart.
uint64_t spreadBits(uint64_t x) {
    x = (x | x << 32) & 0x1f00000000ffffULL;
    x = (x | x << 16) & 0x1f0000ff0000ffULL;
    x = (x | x << 8) & 0x100f00f00f00f00fULL;
    x = (x | x << 4) & 0x10c30c30c30c30c3ULL;
    return (x | x << 2) & 0x1249249249249249ULL;
}

uint64_t mortonCode(const Vec3d& p) {
    const auto bits = [](double x) {
        return spreadBits(uint64_t(std::clamp(x, 0.0, double((1 << kLatticeBits) - 1))));
    };
    return bits(p.x) | bits(p.y) << 1 | bits(p.z) << 2;
}

float roundDown(double x) {
    return std::nextafter(float(x), -kInfinity);
}
float roundUp(double x) {
    return std::nextafter(float(x), kInfinity);
}

/// A difference of two floats is off by 2^-24 of itself, a sum of squares by little more.
constexpr float kGapSlack = 1 - 1e-5f;
/// More than the rounding error of a distance, so that what is pruned cannot depend on the order.
constexpr double kRounding = 1e-6;
/// Ratios are kept as floats: what ties with the best must still be looked at.
constexpr double kRatioSlack = 1 + 1e-6;

uint64_t packBest(float ratio, uint32_t tag) {
    return uint64_t(std::bit_cast<uint32_t>(ratio)) << 32 | tag;
}

float square(float x) {
    return x * x;
}

}  // namespace

struct SampleIndex::Query {
    float min[3], max[3];
    Box3d box;
    const TriangleCorners* corners;
    std::optional<TriangleDistance> triangle;  // prepared when first needed
    double reach;
    float reach_up;
    uint32_t tag;

    Query(const TriangleCorners& t, double triangle_reach, uint32_t triangle_tag)
        : corners(&t), reach(triangle_reach), reach_up(roundUp(triangle_reach)), tag(triangle_tag) {
        for (const Vec3d& corner : t) box.add(corner);
        for (int axis = 0; axis < 3; ++axis) {
            min[axis] = roundDown(box.min[axis]);
            max[axis] = roundUp(box.max[axis]);
        }
    }

    /// A lower bound of the squared distance of the box to a point.
    double boxDistanceSq(const Vec3d& p) const {
        const Vec3d gap = glm::max(glm::max(box.min - p, p - box.max), Vec3d(0));
        return glm::dot(gap, gap) * (1 - 1e-12);
    }

    double distance(const Vec3d& p) {
        if (!triangle) triangle.emplace(*corners);
        return triangle->distance(p);
    }
};

SampleIndex::~SampleIndex() = default;

SampleIndex::SampleIndex(std::vector<Sample> samples, Budget& budget)
    : reservation_(budget.reserve(bytesFor(samples.size()), "the certificate's samples")) {
    std::vector<std::pair<uint64_t, uint32_t>> order(samples.size());
    for (uint32_t i = 0; i < samples.size(); ++i) order[i] = {mortonCode(samples[i].position), i};
    std::sort(order.begin(), order.end(), [&](const auto& a, const auto& b) {
        if (a.first != b.first) return a.first < b.first;
        const auto rank = [](const Sample& s) {
            return std::tuple(s.position.x, s.position.y, s.position.z, s.owner, s.reach);
        };
        return rank(samples[a.second]) < rank(samples[b.second]);
    });
    samples_.reserve(samples.size());
    for (const auto& [code, i] : order) samples_.push_back(samples[i]);
    best_ = std::make_unique<std::atomic<uint64_t>[]>(samples_.size());
    buildTree();
    restart();
}

void SampleIndex::buildTree() {
    for (size_t children = samples_.size(); children > 0;) {
        const size_t nodes = (children + kWidth - 1) / kWidth;
        const size_t depth = levels_.size();
        std::vector<Octet> level((nodes + kWidth - 1) / kWidth);
        for (Octet& octet : level)
            for (int axis = 0; axis < 3; ++axis) {
                // Absent siblings are infinitely far away.
                std::fill_n(octet.min[axis], kWidth, kInfinity);
                std::fill_n(octet.max[axis], kWidth, -kInfinity);
            }
        for (size_t child = 0; child < children; ++child)
            addBox(depth, child, level[child / kWidth / kWidth], child / kWidth % kWidth);
        levels_.push_back(std::move(level));
        children = nodes == 1 ? 0 : nodes;
    }
}

/// Enlarges box k of the octet, on level `depth`, by that of a child: a sample or a node below.
void SampleIndex::addBox(size_t depth, size_t child, Octet& octet, size_t k) const {
    for (int axis = 0; axis < 3; ++axis) {
        float low, high;
        if (depth == 0) {
            low = roundDown(samples_[child].position[axis]);
            high = roundUp(samples_[child].position[axis]);
        } else {
            const Octet& below = levels_[depth - 1][child / kWidth];
            low = below.min[axis][child % kWidth];
            high = below.max[axis][child % kWidth];
        }
        octet.min[axis][k] = std::min(octet.min[axis][k], low);
        octet.max[axis][k] = std::max(octet.max[axis][k], high);
    }
}

void SampleIndex::restart() {
    for (size_t i = 0; i < samples_.size(); ++i)
        best_[i].store(packBest(kMaxRatio, kNoTag), std::memory_order_relaxed);
    size_t nodes = samples_.size();
    for (size_t level = 0; level < levels_.size(); ++level) {
        nodes = (nodes + kWidth - 1) / kWidth;
        for (size_t node = 0; node < nodes; ++node)
            level == 0 ? refreshLeaf(node) : refreshOctet(level, node);
    }
}

float SampleIndex::ratio(size_t i) const {
    return std::bit_cast<float>(uint32_t(best_[i].load(std::memory_order_relaxed) >> 32));
}

/// Concurrent refreshes may store an older, larger radius over a newer one: that is slower but
/// safe, as radii only shrink.
void SampleIndex::refreshLeaf(size_t leaf) {
    float radius = 0;
    for (size_t i = leaf * kWidth; i < std::min(samples_.size(), (leaf + 1) * kWidth); ++i)
        radius = std::max(radius, roundUp(samples_[i].reach * ratio(i) * kRatioSlack));
    levels_[0][leaf / kWidth].radius[leaf % kWidth].store(radius, std::memory_order_relaxed);
}

void SampleIndex::refreshOctet(size_t level, size_t node) {
    const Octet& below = levels_[level - 1][node];
    float radius = 0;  // absent siblings have that, too
    for (size_t k = 0; k < kWidth; ++k)
        radius = std::max(radius, below.radius[k].load(std::memory_order_relaxed));
    levels_[level][node / kWidth].radius[node % kWidth].store(radius, std::memory_order_relaxed);
}

bool SampleIndex::visitLeaf(size_t leaf, Query& query) {
    bool changed = false;
    for (size_t i = leaf * kWidth; i < std::min(samples_.size(), (leaf + 1) * kWidth); ++i) {
        const Sample& sample = samples_[i];
        const double reach = sample.reach * query.reach;
        const double look = reach * ratio(i) * kRatioSlack + kRounding;
        if (query.boxDistanceSq(sample.position) > look * look) continue;
        const uint64_t best = packBest(float(query.distance(sample.position) / reach), query.tag);
        uint64_t before = best_[i].load(std::memory_order_relaxed);
        while (best < before) {
            changed = true;
            if (best_[i].compare_exchange_weak(before, best, std::memory_order_relaxed)) break;
        }
    }
    if (changed) refreshLeaf(leaf);
    return changed;
}

/// Visits those children of a node that the triangle may concern; they lie on `level`.
bool SampleIndex::descend(size_t level, size_t node, Query& query) {
    const Octet& octet = levels_[level][node];
    float gap_sq[kWidth];
    for (size_t k = 0; k < kWidth; ++k) {
        gap_sq[k] = 0;
        for (int axis = 0; axis < 3; ++axis) {
            const float below = octet.min[axis][k] - query.max[axis];
            const float above = query.min[axis] - octet.max[axis][k];
            gap_sq[k] += square(std::max(std::max(below, above), 0.0f));
        }
    }
    bool changed = false;
    for (size_t k = 0; k < kWidth; ++k) {
        const float radius = octet.radius[k].load(std::memory_order_relaxed);
        const float look = radius * query.reach_up + float(kRounding);
        if (gap_sq[k] * kGapSlack > square(look)) continue;
        const size_t child = node * kWidth + k;
        changed |= level == 0 ? visitLeaf(child, query) : descend(level - 1, child, query);
    }
    if (changed && level + 1 < levels_.size()) refreshOctet(level + 1, node);
    return changed;
}

void SampleIndex::visit(std::span<const TriangleCorners> triangles, double reach, uint32_t tag) {
    CHECK(reach > 0 && std::isfinite(reach) && tag != kNoTag);
    if (samples_.empty()) return;
    for (const TriangleCorners& triangle : triangles) {
        Query query(triangle, reach, tag);
        descend(levels_.size() - 1, 0, query);
    }
}

}  // namespace pietra
