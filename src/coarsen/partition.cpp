#include "coarsen/partition.h"

#include <algorithm>
#include <cstring>
#include <unordered_map>

#include "base/check.h"
#include "base/parallel.h"
#include "coarsen/triangle_ahead.h"

namespace pietra {

namespace {

constexpr uint64_t kAimedBucketTriangles = 1 << 16;

/// Level of the buckets: surfaces fill about 6 * 1.6^level cells.
int bucketLevel(uint64_t triangles, CellShape shape) {
    int level = 0;
    for (double cells = 6; cells * double(kAimedBucketTriangles) < double(triangles); cells *= 1.6)
        ++level;
    if (shape == CellShape::kCubes) level = (level + 2) / 3 * 3;
    return std::min(level, 18);
}

}  // namespace

// Deals records into the buckets of one level below one cell, through a buffer a bucket.
struct Partition::Dealer {
    Dealer(Partition& partition, CellId below, int level, size_t buffer_bytes)
        : partition(partition),
          level(level),
          flush_bytes(
              std::clamp(buffer_bytes >> std::min(below ? level - cellLevel(below) : level, 20),
                         size_t(4096), size_t(1) << 18)) {}

    struct Buffers {
        std::vector<std::byte> own, ghost;
    };

    /// Routes records [0, count) of `own_bytes_` each: as owner (their barycentre), and as ghosts.
    void deal(std::span<const std::byte> records, bool ghosts_only, size_t record_bytes,
              CellId within);

    static void findCubes(std::span<const Vec3i> points, std::span<CellPath> paths);

    void append(size_t bucket, bool ghost, const std::byte* record, size_t bytes) {
        Buffers& b = buffers[bucket];
        std::vector<std::byte>& buffer = ghost ? b.ghost : b.own;
        if (buffer.capacity() < flush_bytes) buffer.reserve(flush_bytes + bytes);
        buffer.insert(buffer.end(), record, record + bytes);
        if (buffer.size() >= flush_bytes) flush(bucket, ghost);
    }

    void flush(size_t bucket, bool ghost) {
        std::vector<std::byte>& buffer = ghost ? buffers[bucket].ghost : buffers[bucket].own;
        if (buffer.empty()) return;
        const size_t record = ghost ? kGhostRecordBytes : partition.own_bytes_;
        const Chunk chunk{partition.records_.append(buffer), uint32_t(buffer.size() / record)};
        Bucket& b = buckets[bucket];
        (ghost ? b.ghost : b.own).push_back(chunk);
        (ghost ? b.ghost_count : b.own_count) += chunk.triangles;
        buffer.clear();
    }

    size_t bucketFor(CellId cell) {
        const auto [at, is_new] = index.try_emplace(cell, buckets.size());
        if (is_new) {
            buckets.emplace_back().cell = cell;
            buffers.emplace_back();
        }
        return at->second;
    }

    void finish() {
        for (size_t b = 0; b < buckets.size(); ++b)
            for (bool ghost : {false, true}) flush(b, ghost);
        for (Bucket& b :
             buckets)  // a cell with ghosts alone has nothing to say to anybody but them
            if (b.own_count + b.ghost_count > 0) partition.buckets_.push_back(std::move(b));
    }

    Partition& partition;
    int level;
    size_t flush_bytes;
    std::unordered_map<CellId, size_t> index;
    std::vector<Bucket> buckets;
    std::vector<Buffers> buffers;
};

/// Of a triangle, then of its corners.
void Partition::Dealer::findCubes(std::span<const Vec3i> points, std::span<CellPath> paths) {
    for (size_t i = 0; i < points.size(); i += 4) {
        for (size_t k = 1; k < 4; ++k) paths[i + k] = cubePath(points[i + k]);
        paths[i] = std::max({paths[i + 1], paths[i + 2], paths[i + 3]});
    }
}

void Partition::Dealer::deal(std::span<const std::byte> records, bool ghosts_only,
                             size_t record_bytes, CellId within) {
    constexpr size_t kSlice = 4096;
    const size_t corner_bytes = record_bytes / 3;
    const size_t count = records.size() / record_bytes;
    // Four cells a triangle: of the barycentre, then of the corners.
    std::vector<std::array<CellId, 4>> cells(count);
    std::atomic<uint64_t> degenerate{0};
    parallelForSlices(count, kSlice, [&](size_t begin, size_t end) {
        std::vector<Vec3i> points(4 * (end - begin));
        std::vector<CellPath> paths(points.size());
        uint64_t dropped = 0;
        for (size_t t = begin; t < end; ++t) {
            Vec3i* p = &points[4 * (t - begin)];
            std::array<uint64_t, 3> key;
            for (size_t k = 0; k < 3; ++k) {
                key[k] = VertexRecord::key(records.data() + t * record_bytes + k * corner_bytes);
                p[k + 1] = latticePoint(key[k]);
            }
            if (partition.shape_ == CellShape::kTetrahedra) {
                p[0] = p[1] + p[2] + p[3];
                for (size_t k = 1; k < 4; ++k) p[k] *= 3;
            }
            if (key[0] == key[1] || key[1] == key[2] || key[2] == key[0]) {
                ++dropped;
                cells[t] = {};
            } else {
                cells[t][0] = 1;
            }
        }
        if (partition.shape_ == CellShape::kCubes)
            findCubes(points, paths);
        else
            cellPaths(points, 3, paths, level);
        for (size_t t = begin; t < end; ++t)
            if (cells[t][0] != 0)
                for (size_t k = 0; k < 4; ++k)
                    cells[t][k] = cellAt(paths[4 * (t - begin) + k], level);
        degenerate.fetch_add(dropped, std::memory_order_relaxed);
    });
    partition.degenerate_ += degenerate;
    for (size_t t = 0; t < count; ++t) {
        const std::array<CellId, 4>& cell = cells[t];
        if (cell[0] == 0) continue;
        const std::byte* record = records.data() + t * record_bytes;
        if (!ghosts_only) append(bucketFor(cell[0]), false, record, record_bytes);
        if (!ghosts_only && cell[1] == cell[0] && cell[2] == cell[0] && cell[3] == cell[0])
            continue;
        std::byte ghost[kGhostRecordBytes];
        for (size_t k = 0; k < 3; ++k) std::memcpy(ghost + 8 * k, record + k * corner_bytes, 8);
        for (size_t k = 1; k < 4; ++k) {
            if (!ghosts_only && cell[k] == cell[0]) continue;
            if (std::find(cell.begin() + 1, cell.begin() + ptrdiff_t(k), cell[k]) !=
                cell.begin() + ptrdiff_t(k))
                continue;
            if (within && !cellContains(within, cell[k])) continue;
            append(bucketFor(cell[k]), true, ghost, kGhostRecordBytes);
        }
    }
}

Partition::Partition(TriangleSource& source, const VertexTable& vertices,
                     const PartitionSettings& settings, TempSpace& space, Progress& progress)
    : shape_(settings.shape), own_bytes_(3 * vertices.record().bytes), records_(space) {
    progress.beginStage("partition", source.triangleCountHint());
    {
        Dealer dealer(*this, 0, bucketLevel(source.triangleCountHint(), shape_),
                      settings.buffer_bytes);
        std::vector<std::array<uint64_t, 3>> index;
        std::vector<std::byte> corners;
        TriangleAhead triangles(source, settings.batch_triangles);
        while (triangles.next(index)) {
            vertices.gather(index, corners);
            dealer.deal(corners, false, own_bytes_, 0);
            triangles_ += index.size();
            progress.tick(index.size());
        }
        dealer.finish();
    }
    divideOversized(settings, progress);
    triangles_ -= degenerate_;
    std::sort(buckets_.begin(), buckets_.end(), [](const Bucket& a, const Bucket& b) {
        return firstPath(a.cell) < firstPath(b.cell);
    });
}

void Partition::divideOversized(const PartitionSettings& settings, Progress& progress) {
    for (size_t b = 0; b < buckets_.size(); ++b) {
        if (buckets_[b].own_count <= settings.bucket_triangles) continue;
        const int level = std::min(cellLevel(buckets_[b].cell) + buckets_[b].step, kMaxCellLevel);
        if (level == cellLevel(buckets_[b].cell)) continue;
        const Bucket big = std::move(buckets_[b]);
        buckets_[b] = Bucket{};  // dropped below
        Dealer dealer(*this, big.cell, level, settings.buffer_bytes);
        std::vector<std::byte> records;
        for (bool ghosts : {false, true})
            for (const Chunk& chunk : ghosts ? big.ghost : big.own) {
                const size_t bytes = ghosts ? kGhostRecordBytes : own_bytes_;
                records.resize(chunk.triangles * bytes);
                records_.read(chunk.position, records);
                dealer.deal(records, ghosts, bytes, big.cell);
                progress.tick(0);
            }
        // Where all went one way (many triangles around one point), the next step is longer.
        if (dealer.buckets.size() == 1) dealer.buckets[0].step = 2 * big.step;
        dealer.finish();  // appended at the end: looked at again by this very loop
    }
    std::erase_if(buckets_, [](const Bucket& b) { return b.cell == 0; });
}

size_t Partition::bucketOf(const Vec3i& a, const Vec3i& b, const Vec3i& c) const {
    const CellPath path = trianglePath(shape_, a, b, c);
    const auto after =
        std::upper_bound(buckets_.begin(), buckets_.end(), path,
                         [](CellPath a, const Bucket& b) { return a < firstPath(b.cell); });
    CHECK(after != buckets_.begin());
    return size_t(after - buckets_.begin()) - 1;
}

std::vector<std::byte> Partition::readChunks(const std::vector<Chunk>& chunks, uint64_t count,
                                             size_t record_bytes) const {
    std::vector<std::byte> records(count * record_bytes);
    size_t at = 0;
    for (const Chunk& chunk : chunks) {
        const size_t bytes = chunk.triangles * record_bytes;
        records_.read(chunk.position, std::span(records).subspan(at, bytes));
        at += bytes;
    }
    return records;
}

}  // namespace pietra
