#pragma once
// Welds equal positions that come soon after each other: gives an index to each corner of triangles
// that name no vertices.
//
// A table of the latest positions, in buckets of two, found by a hash of their bits; a position
// that has been pushed out counts as new. So a vertex may come out more than once, but in orders
// that files have it seldom does. The result depends on the corners and their order alone. Memory:
// 2 MiB for floats, 4 MiB for doubles, once used. Not thread-safe.

#include <bit>
#include <cstdint>
#include <span>
#include <type_traits>
#include <vector>

#include "geometry/vec.h"

namespace pietra {

template <class Real>
class VertexWindow {
public:
    using Position = glm::vec<3, Real>;

    /// How many vertices there are so far.
    uint64_t vertexCount() const { return count_; }

    /// Forgets everything and gives the memory back.
    void clear() {
        std::vector<Bucket>().swap(buckets_);
        count_ = 0;
    }

    /// Writes to `index` the vertex that each corner is, and to `fresh` the positions of those that
    /// are new, which get the numbers from vertexCount() on; returns how many. Both have room for
    /// all corners. Corners are finite and have no negative zeros: bits are compared.
    size_t weld(std::span<const Position> corners, uint64_t* index, Vec3d* fresh) {
        prepare(corners.size());
        for (size_t i = 0; i < corners.size(); ++i) bucket_of_[i] = bucketOf(corners[i]);
        const uint64_t first = count_;
        // note: no branches, for every other triangle brings a new vertex, and no predictor knows
        // which.
        for (size_t i = 0; i < corners.size(); ++i) {
            __builtin_prefetch(&buckets_[bucket_of_[i + kAhead]]);
            Bucket& bucket = buckets_[bucket_of_[i]];
            const Entry latest = bucket.latest;
            const Entry corner(corners[i], uint32_t(count_));
            const bool is_latest = corner.equals(latest), is_older = corner.equals(bucket.older);
            const uint32_t known = is_latest ? latest.low : bucket.older.low;
            const bool is_new = !is_latest & !is_older;
            bucket.latest = corner;
            bucket.latest.low = is_new ? corner.low : known;
            if (!is_latest) bucket.older = latest;
            fresh[count_ - first] = Vec3d(corners[i]);
            index[i] = count_ - uint32_t(corner.low - bucket.latest.low);
            count_ += is_new;
        }
        return size_t(count_ - first);
    }

private:
    static constexpr int kBucketBits = 16;
    static constexpr size_t kAhead = 12;
    static constexpr uint64_t kFactor = 0x9e3779b97f4a7c15;
    using Bits = std::conditional_t<sizeof(Real) == 4, uint32_t, uint64_t>;

    struct Entry {
        Bits x = ~Bits(0), y = 0, z = 0;  ///< no number at first: equal to no corner
        uint32_t low = 0;                 ///< of the index: the rest follows from its age

        Entry() = default;
        Entry(const Position& p, uint32_t low_half)
            : x(std::bit_cast<Bits>(p.x)),
              y(std::bit_cast<Bits>(p.y)),
              z(std::bit_cast<Bits>(p.z)),
              low(low_half) {}
        bool equals(const Entry& e) const { return ((x ^ e.x) | (y ^ e.y) | (z ^ e.z)) == 0; }
    };
    struct Bucket {
        Entry latest, older;
    };

    static uint32_t bucketOf(const Position& p) {
        const uint64_t x = std::bit_cast<Bits>(p.x), y = std::bit_cast<Bits>(p.y),
                       z = std::bit_cast<Bits>(p.z);
        const uint64_t mixed = (x ^ std::rotl(y, 32)) * kFactor;
        return uint32_t((std::rotl(mixed, 32) ^ z) * kFactor >> (64 - kBucketBits));
    }

    void prepare(size_t corners) {
        bucket_of_.resize(corners + kAhead);  // zeros at the end
        // note: the low halves of two indices in the table must differ by less than 2^32.
        const bool wraps = (count_ + corners) >> 31 != count_ >> 31;
        if (buckets_.empty() || wraps) buckets_.assign(size_t(1) << kBucketBits, Bucket());
    }

    std::vector<Bucket> buckets_;
    std::vector<uint32_t> bucket_of_;
    uint64_t count_ = 0;
};

}  // namespace pietra
