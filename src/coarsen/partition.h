#pragma once
// First half of the partition (Cignoni et al. 2004, section 5.1): one pass over the triangles deals
// them into buckets, coarse cells of the hierarchy, by the path of their barycentre (of
// cubes: by the last of their corners'; these buckets are cubes). A triangle
// with a corner in the cell of another bucket is also sent there as a *ghost*, so that every bucket
// sees all triangles around the vertices that lie in its cell. Triangles that collapse on the
// lattice are dropped and counted. Within a bucket triangles keep the order of the input: content
// and order do not depend on memory or threads.

#include <cstdint>
#include <vector>

#include "base/progress.h"
#include "coarsen/cell_path.h"
#include "coarsen/vertex_table.h"
#include "extmem/spill.h"
#include "io/triangle_source.h"

namespace pietra {

/// A run of records in the partition's temporary data.
struct Chunk {
    uint64_t position;
    uint32_t triangles;
};

struct Bucket {
    CellId cell = 0;
    uint64_t own_count = 0;    ///< triangles whose barycentre is in the cell
    int step = 3;              ///< levels to go down where it must be divided
    uint64_t ghost_count = 0;  ///< triangles of other buckets with a corner in the cell
    std::vector<Chunk> own;    ///< records of three VertexRecords
    std::vector<Chunk> ghost;  ///< records of three keys
};

struct PartitionSettings {
    size_t batch_triangles = 1 << 20;     ///< gathered at a time
    size_t buffer_bytes = 64 << 20;       ///< for all buckets' unwritten records together
    uint64_t bucket_triangles = 1 << 19;  ///< larger buckets are divided again
    CellShape shape = CellShape::kTetrahedra;
};

class Partition {
public:
    Partition(TriangleSource& source, const VertexTable& vertices,
              const PartitionSettings& settings, TempSpace& space, Progress& progress);

    /// Non-empty buckets in path order; their cells are disjoint and hold every triangle kept.
    const std::vector<Bucket>& buckets() const { return buckets_; }
    /// Which bucket has the triangle.
    size_t bucketOf(const Vec3i& a, const Vec3i& b, const Vec3i& c) const;
    CellShape shape() const { return shape_; }
    uint64_t triangleCount() const { return triangles_; }
    uint64_t degenerateCount() const { return degenerate_; }

    size_t ownRecordBytes() const { return own_bytes_; }
    static constexpr size_t kGhostRecordBytes = 24;
    /// All records of a bucket, concatenated.
    std::vector<std::byte> readOwn(const Bucket& bucket) const {
        return readChunks(bucket.own, bucket.own_count, own_bytes_);
    }
    std::vector<std::byte> readGhosts(const Bucket& bucket) const {
        return readChunks(bucket.ghost, bucket.ghost_count, kGhostRecordBytes);
    }
    /// Frees all records.
    void clear() { records_.clear(); }

private:
    struct Dealer;
    std::vector<std::byte> readChunks(const std::vector<Chunk>& chunks, uint64_t count,
                                      size_t record_bytes) const;
    void divideOversized(const PartitionSettings& settings, Progress& progress);
    CellShape shape_;
    size_t own_bytes_;
    Spill records_;
    std::vector<Bucket> buckets_;
    uint64_t triangles_ = 0, degenerate_ = 0;
};

}  // namespace pietra
