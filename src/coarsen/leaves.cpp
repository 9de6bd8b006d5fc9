#include "coarsen/leaves.h"

#include <algorithm>
#include <cstring>
#include <mutex>

#include "base/check.h"
#include "base/parallel.h"
#include "coarsen/mesh_joiner.h"

namespace pietra {

namespace {

struct WeldedBlob {
    uint64_t position = 0;
    size_t triangles = 0;
    size_t vertices = 0;
    size_t component_runs = 0;
    std::vector<std::pair<uint64_t, uint32_t>> messages;  // runs in the message spill
};

/// Welded buckets and messages between the two passes.
class BucketRepository {
public:
    BucketRepository(TempSpace& space, const VertexRecord& record, size_t buckets)
        : record_(record), meshes_(space), messages_(space), blobs_(buckets) {}

    void put(size_t bucket, WeldedBucket&& welded) {
        const Mesh& mesh = welded.bucket.mesh;
        std::vector<std::byte> out;
        const auto pack = [&](const auto& values) {
            const auto bytes = std::as_bytes(std::span(values));
            out.insert(out.end(), bytes.begin(), bytes.end());
        };
        pack(mesh.position);
        pack(mesh.normal);
        pack(mesh.colour);
        pack(mesh.scalar);
        pack(mesh.triangle);
        pack(mesh.edge_class);
        pack(welded.bucket.is_inside);
        pack(welded.bucket.components.runs);
        blobs_[bucket].position = meshes_.append(out);
        blobs_[bucket].triangles = mesh.triangle.size();
        blobs_[bucket].vertices = mesh.position.size();
        blobs_[bucket].component_runs = welded.bucket.components.runs.size();
        putMessages(welded.messages);
    }

    BucketMesh get(size_t bucket) const {
        const WeldedBlob& blob = blobs_[bucket];
        const size_t v = blob.vertices, t = blob.triangles;
        BucketMesh out;
        uint64_t at = blob.position;
        const auto unpack = [&](auto& values, size_t count) {
            values.resize(count);
            const auto bytes = std::as_writable_bytes(std::span(values));
            meshes_.read(at, bytes);
            at += bytes.size();
        };
        unpack(out.mesh.position, v);
        unpack(out.mesh.normal, v);
        unpack(out.mesh.colour, record_.colours ? v : 0);
        unpack(out.mesh.scalar, v * record_.scalar_count);
        unpack(out.mesh.triangle, t);
        unpack(out.mesh.edge_class, t);
        unpack(out.is_inside, v);
        unpack(out.components.runs, blob.component_runs);
        std::vector<Message> messages;
        for (const auto& [position, count] : blob.messages) {
            const size_t had = messages.size();
            messages.resize(had + count);
            messages_.read(position, std::as_writable_bytes(std::span(messages).subspan(had)));
        }
        applyMessages(messages, out);
        return out;
    }

private:
    void putMessages(std::vector<std::pair<size_t, Message>>& messages) {
        std::stable_sort(messages.begin(), messages.end(),
                         [](const auto& a, const auto& b) { return a.first < b.first; });
        std::vector<Message> run;
        for (size_t begin = 0; begin < messages.size();) {
            const size_t to = messages[begin].first;
            run.clear();
            size_t end = begin;
            for (; end < messages.size() && messages[end].first == to; ++end)
                run.push_back(messages[end].second);
            const uint64_t position = messages_.append(std::as_bytes(std::span(run)));
            const std::lock_guard lock(mutex_);
            blobs_[to].messages.emplace_back(position, uint32_t(run.size()));
            begin = end;
        }
    }

    const VertexRecord& record_;
    Spill meshes_, messages_;
    std::vector<WeldedBlob> blobs_;
    std::mutex mutex_;
};

/// Cuts leaves out of buckets. A leaf is a run of triangles of one bucket, or of several whole
/// ones.
class LeafCutter {
public:
    LeafCutter(const ComponentTable& components, float bound, CellShape shape)
        : components_(components), bound_(bound), shape_(shape) {}

    /// Appends the triangles of `bucket` that lie in the cell.
    void add(const BucketMesh& bucket, CellId cell) {
        const Mesh& mesh = bucket.mesh;
        const CellPath after = lastPath(cell) + 1;  // 0 where the cell is the last of all
        const size_t begin = findPath(mesh, firstPath(cell)),
                     end = after == 0 ? mesh.triangle.size() : findPath(mesh, after);
        for (size_t t = begin; t < end; ++t) joiner_.addTriangle(mesh, t);
        if (begin < end) out_.closed = out_.closed && allClosed(bucket.components.runs, begin, end);
    }

    /// The leaf so far; starts the next.
    const CellMesh& finish() {
        const size_t count = out_.mesh.triangle.size();
        out_.bounds.to_original.assign(count, bound_);
        out_.bounds.from_original.assign(count, bound_);
        return out_;
    }
    void start() {
        out_.mesh.clear();
        out_.closed = true;
        joiner_.begin(out_.mesh, 0);
    }

private:
    bool allClosed(const std::vector<ComponentRun>& runs, size_t begin, size_t end) const {
        auto run = std::upper_bound(runs.begin(), runs.end(), begin,
                                    [](size_t t, const ComponentRun& r) { return t < r.first; });
        for (--run; run != runs.end() && run->first < end; ++run)
            if (!components_.isClosed(run->component)) return false;
        return true;
    }

    size_t findPath(const Mesh& mesh, CellPath path) const {
        size_t low = 0, high = mesh.triangle.size();
        if (path == 0) return 0;
        while (low < high) {
            const size_t middle = (low + high) / 2;
            if (trianglePath(mesh, middle, shape_) < path)
                low = middle + 1;
            else
                high = middle;
        }
        return low;
    }

    const ComponentTable& components_;
    float bound_;
    CellShape shape_;
    MeshJoiner joiner_;
    CellMesh out_;
};

}  // namespace

Leaves buildLeaves(Partition& partition, const VertexRecord& record, const LeafSettings& settings,
                   TempSpace& space, CellStore& store, Progress& progress) {
    const std::vector<Bucket>& buckets = partition.buckets();
    BucketRepository repository(space, record, buckets.size());
    ComponentTable components(space, settings.component_bytes);
    Leaves leaves;
    std::mutex mutex;
    std::vector<LeafCell> cells;

    progress.beginStage("weld", partition.triangleCount());
    parallelFor(buckets.size(), [&](size_t b) {
        WeldedBucket welded =
            weldBucket(partition, b, record, settings.leaf_triangles, settings.mark_irregular);
        {
            const std::lock_guard lock(mutex);
            cells.insert(cells.end(), welded.leaves.begin(), welded.leaves.end());
            leaves.duplicates += welded.duplicates;
            leaves.triangles += welded.bucket.mesh.triangleCount();
            leaves.edges += welded.edges;
        }
        components.add(welded.bucket.components);
        repository.put(b, std::move(welded));
        progress.tick(buckets[b].own_count);
    });
    partition.clear();
    components.resolve();
    leaves.tree = std::make_unique<CellTree>(cells, settings.leaf_triangles, partition.shape());

    progress.beginStage("cut leaves", leaves.triangles);
    // Tasks: runs of leaves that begin in the same bucket.
    const std::vector<CellId>& order = leaves.tree->leaves();
    const auto bucketAt = [&](CellPath path) {
        const auto after =
            std::upper_bound(buckets.begin(), buckets.end(), path,
                             [](CellPath a, const Bucket& b) { return a < firstPath(b.cell); });
        return after == buckets.begin() ? size_t(0) : size_t(after - buckets.begin()) - 1;
    };
    std::vector<std::pair<size_t, size_t>> runs;  // of leaves
    for (size_t i = 0; i < order.size(); ++i)
        if (i == 0 || bucketAt(firstPath(order[i])) != bucketAt(firstPath(order[i - 1])))
            runs.emplace_back(i, i + 1);
        else
            runs.back().second = i + 1;
    parallelFor(runs.size(), [&](size_t r) {
        LeafCutter cutter(components, settings.bound, partition.shape());
        size_t loaded = bucketAt(firstPath(order[runs[r].first]));
        BucketMesh bucket = repository.get(loaded);
        for (size_t i = runs[r].first; i < runs[r].second; ++i) {
            cutter.start();
            const CellId leaf = order[i];
            for (size_t b = bucketAt(firstPath(leaf)); b < buckets.size(); ++b) {
                if (firstPath(buckets[b].cell) > lastPath(leaf)) break;
                if (b != loaded) bucket = repository.get(loaded = b);
                cutter.add(bucket, leaf);
            }
            const CellMesh& mesh = cutter.finish();
            if (mesh.mesh.triangle.empty()) continue;  // a forced split's empty half
            const CellBlob blob = store.put(mesh);
            {
                const std::lock_guard lock(mutex);
                leaves.blobs.emplace(leaf, blob);
            }
            progress.tick(blob.triangles);
        }
    });
    return leaves;
}

}  // namespace pietra
