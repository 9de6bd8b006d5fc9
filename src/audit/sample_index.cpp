#include "audit/sample_index.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>
#include <tuple>

#include "base/check.h"
#include "base/parallel.h"
#include "geometry/lattice.h"
#include "geometry/morton.h"

namespace pietra {

namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Of a point near the lattice.
uint64_t codeOf(const Vec3d& p) {
    constexpr Vec3d kLast((1 << kLatticeBits) - 1);
    return mortonCode(Vec3i(glm::clamp(p, Vec3d(0), kLast)));
}

/// Outward by at least the rounding of the conversion; cheaper than the next float.
float roundUp(double x) {
    const auto f = float(x);
    return f + (std::abs(f) * 0x1p-22f + 1e-30f);
}

float roundDown(double x) {
    return -roundUp(-x);
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

/// A box in floats, rounded outward; starts empty.
struct SampleIndex::QueryBox {
    float min[3] = {kInfinity, kInfinity, kInfinity};
    float max[3] = {-kInfinity, -kInfinity, -kInfinity};

    void add(const QueryBox& other) {
        for (int axis = 0; axis < 3; ++axis) {
            min[axis] = std::min(min[axis], other.min[axis]);
            max[axis] = std::max(max[axis], other.max[axis]);
        }
    }
};

struct SampleIndex::Query {
    const TriangleCorners* corners;
    QueryBox box;
    std::optional<TriangleDistance> triangle;  // prepared when first needed

    explicit Query(const TriangleCorners& t) : corners(&t) {
        const Vec3d low = glm::min(glm::min(t[0], t[1]), t[2]);
        const Vec3d high = glm::max(glm::max(t[0], t[1]), t[2]);
        for (int axis = 0; axis < 3; ++axis) {
            box.min[axis] = roundDown(low[axis]);
            box.max[axis] = roundUp(high[axis]);
        }
    }

    double distance(const Vec3d& p) {
        if (!triangle) triangle.emplace(*corners);
        return triangle->distance(p);
    }
};

/// What is common to the triangles of one call, and scratch.
struct SampleIndex::Pass {
    double reach;
    float reach_up;
    uint32_t tag;
    std::vector<Query> queries;
    std::vector<uint32_t> leaves;  // octets of samples that the run at hand concerns
    size_t max_leaves;
};

SampleIndex::~SampleIndex() = default;

SampleIndex::SampleIndex(std::vector<Sample> samples, Budget& budget)
    : reservation_(budget.reserve(bytesFor(samples.size()), "the certificate's samples")) {
    std::vector<std::pair<uint64_t, uint32_t>> order(samples.size());
    for (uint32_t i = 0; i < samples.size(); ++i) order[i] = {codeOf(samples[i].position), i};
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
    for (size_t members = samples_.size(); members > 0;) {
        const size_t octets = (members + kWidth - 1) / kWidth;
        std::vector<Octet> level(octets);
        for (Octet& octet : level)
            for (int axis = 0; axis < 3; ++axis) {
                // Absent members are infinitely far away.
                std::fill_n(octet.min[axis], kWidth, kInfinity);
                std::fill_n(octet.max[axis], kWidth, -kInfinity);
            }
        for (size_t m = 0; m < members; ++m) setBox(level[m / kWidth], m);
        levels_.push_back(std::move(level));
        members = octets == 1 ? 0 : octets;
    }
}

/// Sets the box of member m of the level to be pushed: a sample, or an octet of the level below.
void SampleIndex::setBox(Octet& octet, size_t m) const {
    for (int axis = 0; axis < 3; ++axis) {
        float& low = octet.min[axis][m % kWidth];
        float& high = octet.max[axis][m % kWidth];
        if (levels_.empty()) {
            low = roundDown(samples_[m].position[axis]);
            high = roundUp(samples_[m].position[axis]);
        } else {
            const Octet& below = levels_.back()[m];
            low = *std::min_element(below.min[axis], below.min[axis] + kWidth);
            high = *std::max_element(below.max[axis], below.max[axis] + kWidth);
        }
    }
}

void SampleIndex::restart() {
    for (size_t i = 0; i < samples_.size(); ++i) {
        best_[i].store(packBest(kMaxRatio, kNoTag), std::memory_order_relaxed);
        refreshSample(i);
    }
    for (size_t level = 1; level < levels_.size(); ++level)
        for (size_t m = 0; m < levels_[level - 1].size(); ++m) refreshMember(level, m);
}

float SampleIndex::ratio(size_t i) const {
    return std::bit_cast<float>(uint32_t(best_[i].load(std::memory_order_relaxed) >> 32));
}

void SampleIndex::refreshSample(size_t i) {
    const float radius = roundUp(samples_[i].reach * ratio(i) * kRatioSlack);
    levels_[0][i / kWidth].radius[i % kWidth].store(radius, std::memory_order_relaxed);
}

/// Concurrent refreshes may store an older, larger radius over a newer one: that is slower but
/// safe, as radii only shrink. True if the radius has changed.
bool SampleIndex::refreshMember(size_t level, size_t m) {
    float radius = 0;  // absent members have that, too
    for (const std::atomic<float>& below : levels_[level - 1][m].radius)
        radius = std::max(radius, below.load(std::memory_order_relaxed));
    std::atomic<float>& own = levels_[level][m / kWidth].radius[m % kWidth];
    return own.exchange(radius, std::memory_order_relaxed) != radius;
}

/// After the radii of an octet of samples have changed.
void SampleIndex::refreshAbove(size_t leaf) {
    size_t member = leaf;
    for (size_t level = 1; level < levels_.size(); ++level, member /= kWidth)
        if (!refreshMember(level, member)) return;
}

/// Bit k: the triangles' box is no further from member k than that looks.
unsigned SampleIndex::membersNear(const Octet& octet, const QueryBox& box, float reach) {
    float gap_sq[kWidth] = {};
    for (int axis = 0; axis < 3; ++axis) {
        const float low = box.min[axis], high = box.max[axis];
        for (size_t k = 0; k < kWidth;
             ++k) {  // by values, not std::max: the compiler vectorises it
            const float below = octet.min[axis][k] - high;
            const float above = low - octet.max[axis][k];
            const float either = below > above ? below : above;
            const float gap = either > 0 ? either : 0;
            gap_sq[k] += gap * gap;
        }
    }
    unsigned near = 0;
    for (size_t k = 0; k < kWidth; ++k) {
        const float radius = octet.radius[k].load(std::memory_order_relaxed);
        const float look = radius * reach + float(kRounding);
        near |= unsigned(gap_sq[k] * kGapSlack <= square(look)) << k;
    }
    return near;
}

/// True if the triangle is the best so far for any sample of the octet.
bool SampleIndex::visitLeaf(size_t leaf, Query& query, const Pass& pass) {
    bool changed = false;
    for (unsigned near = membersNear(levels_[0][leaf], query.box, pass.reach_up); near != 0;
         near &= near - 1) {
        const size_t i = leaf * kWidth + size_t(std::countr_zero(near));
        const double d = query.distance(samples_[i].position);
        const uint64_t best = packBest(float(d / (samples_[i].reach * pass.reach)), pass.tag);
        uint64_t before = best_[i].load(std::memory_order_relaxed);
        while (best < before &&
               !best_[i].compare_exchange_weak(before, best, std::memory_order_relaxed)) {
        }
        if (best >= before) continue;
        refreshSample(i);
        changed = true;
    }
    return changed;
}

/// Lists the octets of samples, below an octet of `level`, that look as far as the box. False if
/// there are too many.
bool SampleIndex::collectLeaves(size_t level, size_t octet, const QueryBox& box, Pass& pass) {
    if (level == 0) {
        if (pass.leaves.size() == pass.max_leaves) return false;
        pass.leaves.push_back(uint32_t(octet));
        return true;
    }
    for (unsigned near = membersNear(levels_[level][octet], box, pass.reach_up); near != 0;
         near &= near - 1)
        if (!collectLeaves(level - 1, octet * kWidth + size_t(std::countr_zero(near)), box, pass))
            return false;
    return true;
}

/// Neighbours in the stream mostly are neighbours in space, so they share the way down the tree; a
/// run that concerns too many leaves is split.
void SampleIndex::visitRun(size_t begin, size_t end, Pass& pass) {
    QueryBox box;
    for (size_t t = begin; t < end; ++t) box.add(pass.queries[t].box);
    pass.leaves.clear();
    pass.max_leaves = end - begin > 1 ? kMaxLeaves : samples_.size();
    if (!collectLeaves(levels_.size() - 1, 0, box, pass)) {
        const size_t middle = (begin + end) / 2;
        visitRun(begin, middle, pass);
        visitRun(middle, end, pass);
        return;
    }
    for (const uint32_t leaf : pass.leaves) {
        bool changed = false;
        for (size_t t = begin; t < end; ++t) changed |= visitLeaf(leaf, pass.queries[t], pass);
        if (changed) refreshAbove(leaf);
    }
}

void SampleIndex::visit(std::span<const TriangleCorners> triangles, double reach, uint32_t tag) {
    CHECK(reach > 0 && std::isfinite(reach) && tag != kNoTag);
    if (samples_.empty()) return;
    Pass pass{reach, roundUp(reach), tag, {}, {}, 0};
    for (size_t begin = 0; begin < triangles.size(); begin += kRun) {
        const size_t end = std::min(triangles.size(), begin + kRun);
        pass.queries.clear();
        for (size_t t = begin; t < end; ++t) pass.queries.emplace_back(triangles[t]);
        visitRun(0, pass.queries.size(), pass);
    }
}

}  // namespace pietra
