#pragma once
// Points in memory that wait for a stream of triangles, each to learn which triangle vouches for it
// best: the one of least distance / reach, where the reach is the product of what the point and the
// triangle allow. A ratio over 1 means that no triangle is as near as it should be.
//
// The points are sorted along a curve into an 8-ary tree of boxes; each node knows how far its
// points still look, which shrinks as triangles come. So a triangle costs little where it is far
// from all points or where nearer ones have been; the stream may come in any order, best by
// patches. Memory: bytesFor(). visit() is thread-safe, and results depend neither on the order of
// the triangles nor on the number of threads.

#include <array>
#include <atomic>
#include <cstdint>
#include <limits>
#include <memory>
#include <span>
#include <vector>

#include "geometry/triangle_distance.h"
#include "base/budget.h"

namespace pietra {

struct Sample {
    Vec3d position;      ///< lattice coordinates within [0, 2^21], else the sorting suffers
    double reach = 1;    ///< see SampleIndex; positive and finite
    uint64_t owner = 0;  ///< the caller's
};

class SampleIndex {
public:
    /// Triangles further away than this times the reach are not looked at.
    static constexpr float kMaxRatio = 1.25f;
    static constexpr uint32_t kNoTag = std::numeric_limits<uint32_t>::max();

    /// What n samples take, with what building the tree needs for a while.
    static constexpr size_t kSampleBytes = 144;
    static size_t bytesFor(size_t samples) { return samples * kSampleBytes + 4096; }

    /// Throws MemoryError if the budget has not bytesFor(samples.size()); the budget must outlive
    /// this.
    SampleIndex(std::vector<Sample> samples, Budget& budget);
    ~SampleIndex();

    size_t size() const { return samples_.size(); }
    /// In the index's own order, which depends on the samples alone.
    const Sample& sample(size_t i) const { return samples_[i]; }

    /// `reach`: of these triangles, positive and finite; `tag`: what they are called, not kNoTag.
    void visit(std::span<const TriangleCorners> triangles, double reach, uint32_t tag);
    /// As if no triangle had come yet. Not thread-safe.
    void restart();

    /// The least distance / (sample's reach * triangle's reach) so far, kMaxRatio if there is none.
    float ratio(size_t i) const;
    /// Of the triangle with that ratio, the least one of several; kNoTag if there is none.
    uint32_t tag(size_t i) const { return uint32_t(best_[i].load(std::memory_order_relaxed)); }

private:
    static constexpr size_t kWidth = 8;
    static constexpr size_t kRun = 32;        // triangles that go down the tree together
    static constexpr size_t kMaxLeaves = 64;  // that a run of several may concern
    struct QueryBox;
    struct Query;
    struct Pass;
    /// Boxes of eight members, one array a coordinate, so that they are tested side by side, and
    /// how far each still looks for triangles of reach 1.
    struct Octet {
        float min[3][kWidth];
        float max[3][kWidth];
        std::atomic<float> radius[kWidth];
    };

    void buildTree();
    void setBox(Octet& octet, size_t m) const;
    void refreshSample(size_t i);
    bool refreshMember(size_t level, size_t m);
    void refreshAbove(size_t leaf);
    static unsigned membersNear(const Octet& octet, const QueryBox& box, float reach);
    bool collectLeaves(size_t level, size_t octet, const QueryBox& box, Pass& pass);
    bool visitLeaf(size_t leaf, Query& query, const Pass& pass);
    void visitRun(size_t begin, size_t end, Pass& pass);

    Reservation reservation_;
    std::vector<Sample> samples_;
    // Ratio as a float's bits in the upper half, which sort as the float does, and tag below: the
    // least number is the best triangle.
    std::unique_ptr<std::atomic<uint64_t>[]> best_;
    // Octet o of level 0 holds samples o*kWidth and on, one of level n octets o*kWidth and on of
    // level n-1; the last level has one octet.
    std::vector<std::vector<Octet>> levels_;
};

}  // namespace pietra
