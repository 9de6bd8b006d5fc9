#pragma once
// Which triangles belong to closed, consistently oriented components: those that hang together over
// edges, each of which is used exactly twice, once in either direction, and are not inside out.
// Only these have a back that nobody sees. Inside out is what encloses a negative volume: it may be
// a cavity, whose back nobody sees either, or a mesh whose triangles are all turned over.
//
// A bucket finds the components of its own triangles by union-find (LocalComponents). Most are
// settled there: dust takes no memory outside its bucket. A component with an edge that other
// buckets may use gets a number in the table of the whole model, and tells the table of every use
// it makes of such an edge; these uses wait in a SpillTable. resolve() brings the uses of one edge
// together: two in opposite directions unite two components, anything else makes them all open.
//
// What comes out depends on the triangles alone, not on buckets, order or threads. Memory: 21 bytes
// a numbered component, and that of the SpillTable.

#include <cstdint>
#include <mutex>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "base/disjoint_sets.h"
#include "base/hash.h"
#include "extmem/spill.h"
#include "extmem/spill_table.h"
#include "geometry/lattice.h"

namespace pietra {

/// Settled within one bucket; all else is a number of the table.
inline constexpr uint32_t kClosedComponent = 0xffffffffu, kOpenComponent = 0xfffffffeu;

/// Sums of sixfoldVolume(), exact.
using Volume = __int128;

/// Six times the volume of a tetrahedron, from the middle of the lattice to a triangle: over a
/// closed surface the sum is six times what it encloses.
inline int64_t sixfoldVolume(const Vec3i& a, const Vec3i& b, const Vec3i& c) {
    constexpr int64_t kMiddle = int64_t(1) << (kLatticeBits - 1);
    const Vec3l p = Vec3l(a) - kMiddle, n = crossInteger(Vec3l(b) - kMiddle, Vec3l(c) - kMiddle);
    return p.x * n.x + p.y * n.y + p.z * n.z;
}

/// The triangles from `first` to the next run belong to `component`.
struct ComponentRun {
    uint32_t first;
    uint32_t component;
};

/// A use of an edge that other buckets may use too.
struct SharedEdgeUse {
    uint64_t low, high;  ///< keys of its ends, low < high
    uint32_t component;
    uint32_t forward;  ///< 1: the triangle runs from low to high
    uint64_t hash() const { return mixBits(mixBits(low) + high); }
    bool sameEdge(const SharedEdgeUse& o) const { return low == o.low && high == o.high; }
    bool operator<(const SharedEdgeUse& o) const {
        return std::tie(low, high, component, forward) <
               std::tie(o.low, o.high, o.component, o.forward);
    }
};

/// What one bucket knows. Components that share edges are numbered from 0 in the bucket, and from
/// ComponentTable::add() on in the model.
struct BucketComponents {
    std::vector<ComponentRun> runs;          ///< in order; the first begins at triangle 0
    std::vector<uint8_t> open;               ///< one a numbered component: known not to be closed
    std::vector<Volume> volume;              ///< likewise: of its triangles
    std::vector<SharedEdgeUse> shared_uses;  ///< of the numbered components
};

/// Gathers what is known of the edges of one bucket's triangles.
class LocalComponents {
public:
    explicit LocalComponents(size_t triangles)
        : sets_(triangles), flags_(triangles, 0), volume_(triangles, 0) {}

    /// Two triangles share an edge.
    void unite(uint32_t a, uint32_t b) { sets_.unite(a, b); }
    /// An edge of the triangle is not used twice, once in either direction.
    void markOpen(uint32_t triangle) { flags_[triangle] |= kOpen; }
    void setVolume(uint32_t triangle, int64_t sixfold) { volume_[triangle] = sixfold; }
    /// Other buckets may use an edge of the triangle.
    void share(uint32_t triangle, uint64_t low, uint64_t high, bool forward);

    /// To be called once, after all of the above.
    BucketComponents finish();

private:
    enum : uint8_t { kOpen = 1, kShared = 2 };
    DisjointSets sets_;
    std::vector<uint8_t> flags_;  // per triangle; in the end, that of a set is its root's
    std::vector<Volume> volume_;  // likewise
    std::vector<SharedEdgeUse> shared_uses_;  // .component: the triangle, until finish()
};

/// The components that several buckets may share.
class ComponentTable {
public:
    /// `memory_bytes` of space.budget are for the uses of shared edges, at least 1 MiB.
    ComponentTable(TempSpace& space, size_t memory_bytes);

    /// Numbers the bucket's components for the model, in its runs too. Takes its uses. Thread-safe.
    void add(BucketComponents& bucket);
    /// After the last bucket. Frees all but what isClosed() needs.
    void resolve();
    /// After resolve(). Thread-safe.
    bool isClosed(uint32_t component) const {
        return component == kClosedComponent || (component != kOpenComponent && !open_[component]);
    }

private:
    void join(std::span<const SharedEdgeUse> uses);

    TempSpace& space_;
    std::mutex mutex_;
    DisjointSets sets_;
    std::vector<uint8_t> open_;
    std::vector<Volume> volume_;
    std::optional<SpillTable<SharedEdgeUse>> uses_;
};

}  // namespace pietra
