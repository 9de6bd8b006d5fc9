#include "coarsen/bucket_mesh.h"

#include <algorithm>
#include <bit>
#include <cstring>

#include "base/check.h"
#include "base/hash.h"
#include "coarsen/key_map.h"

namespace pietra {

namespace {

constexpr int kOccupiedLevels = 6;

/// The records of a bucket in path order.
struct SortedRecords {
    std::vector<std::byte> bytes;  // as dealt
    std::vector<std::pair<CellPath, uint32_t>> order;
};

SortedRecords sortByPath(std::vector<std::byte> bytes, size_t record_bytes, CellShape shape) {
    const size_t count = bytes.size() / record_bytes, corner = record_bytes / 3;
    std::vector<CellPath> paths(count);
    std::vector<Vec3i> sums(shape == CellShape::kCubes ? 0 : count);
    for (size_t t = 0; t < count; ++t) {
        const std::byte* r = bytes.data() + t * record_bytes;
        const Vec3i a = latticePoint(VertexRecord::key(r)),
                    b = latticePoint(VertexRecord::key(r + corner)),
                    c = latticePoint(VertexRecord::key(r + 2 * corner));
        if (shape == CellShape::kCubes)
            paths[t] = cubePath(a, b, c);
        else
            sums[t] = a + b + c;
    }
    if (shape == CellShape::kTetrahedra) cellPaths(sums, 3, paths);
    SortedRecords sorted{std::move(bytes), {}};
    sorted.order.resize(count);
    for (size_t t = 0; t < count; ++t) sorted.order[t] = {paths[t], uint32_t(t)};
    std::sort(sorted.order.begin(), sorted.order.end());
    return sorted;
}

/// The work on one bucket: own triangles first, ghosts behind them, over common vertices.
class Welder {
public:
    Welder(const Partition& partition, size_t bucket, const VertexRecord& record)
        : partition_(partition), bucket_(partition.buckets()[bucket]), record_(record) {}

    WeldedBucket run(uint32_t leaf_triangles, bool mark_irregular) {
        weldOwn();
        weldGhosts();
        dropDuplicates();
        findLeaves(leaf_triangles, 0, paths_.size(), cellLevel(bucket_.cell));
        locateVertices();
        if (!record_.normals) sumNormals();
        classifyEdges();
        if (mark_irregular) markIrregular();
        trim();
        return std::move(out_);
    }

private:
    Mesh& mesh() { return out_.bucket.mesh; }

    uint32_t addVertex(const std::byte* record) {
        const uint64_t key = VertexRecord::key(record);
        const auto [index, is_new] = ids_.insert(key, uint32_t(keys_.size()));
        if (is_new) keys_.push_back(key);
        return index;
    }

    void weldOwn() {
        const SortedRecords sorted =
            sortByPath(partition_.readOwn(bucket_), 3 * record_.bytes, partition_.shape());
        ids_.reserve(sorted.order.size());
        mesh().triangle.reserve(sorted.order.size());
        paths_.reserve(sorted.order.size());
        for (const auto& [path, index] : sorted.order) {
            const std::byte* r = sorted.bytes.data() + index * 3 * record_.bytes;
            Triangle triangle;
            for (size_t k = 0; k < 3; ++k) {
                const std::byte* corner = r + k * record_.bytes;
                triangle[k] = addVertex(corner);
                if (triangle[k] == own_vertices_) {
                    ++own_vertices_;
                    addAttributes(corner);
                }
            }
            mesh().triangle.push_back(triangle);
            paths_.push_back(path);
        }
    }

    void addAttributes(const std::byte* record) {
        mesh().normal.emplace_back();
        if (record_.normals) std::memcpy(&mesh().normal.back(), record + record_.normal_offset, 4);
        if (record_.colours)
            std::memcpy(&mesh().colour.emplace_back(), record + record_.colour_offset, 4);
        for (size_t s = 0; s < record_.scalar_count; ++s)
            std::memcpy(&mesh().scalar.emplace_back(), record + record_.scalar_offset + 4 * s, 4);
    }

    void weldGhosts() {
        const std::vector<std::byte> ghosts = partition_.readGhosts(bucket_);
        for (size_t at = 0; at < ghosts.size(); at += Partition::kGhostRecordBytes) {
            Triangle triangle;
            for (size_t k = 0; k < 3; ++k) triangle[k] = addVertex(ghosts.data() + at + 8 * k);
            ghost_.push_back(triangle);
        }
    }

    // Triangles with the same three corners, whichever way round: the first in path order stays.
    void dropDuplicates() {
        const auto sortedCorners = [](Triangle t) {
            std::sort(t.begin(), t.end());
            return t;
        };
        const auto equalSet = [&](const Triangle& a, const Triangle& b) {
            return sortedCorners(a) == sortedCorners(b);
        };
        // Equal triangles have equal paths: only runs need a look.
        size_t kept = 0;
        std::vector<std::pair<Triangle, size_t>> run;
        std::vector<size_t> first;
        std::vector<Triangle>& own = mesh().triangle;
        for (size_t begin = 0; begin < own.size();) {
            size_t end = begin + 1;
            while (end < own.size() && paths_[end] == paths_[begin]) ++end;
            if (end - begin == 1) {
                own[kept] = own[begin];
                paths_[kept++] = paths_[begin];
            } else {
                run.clear();
                first.clear();
                for (size_t i = begin; i < end; ++i) run.emplace_back(sortedCorners(own[i]), i);
                std::sort(run.begin(), run.end());
                for (size_t i = 0; i < run.size(); ++i)
                    if (i == 0 || run[i].first != run[i - 1].first) first.push_back(run[i].second);
                std::sort(first.begin(), first.end());
                for (size_t i : first) {
                    own[kept] = own[i];
                    paths_[kept++] = paths_[begin];
                }
            }
            begin = end;
        }
        out_.duplicates = own.size() - kept;
        own.resize(kept);
        paths_.resize(kept);
        std::sort(ghost_.begin(), ghost_.end(), [&](const Triangle& a, const Triangle& b) {
            return sortedCorners(a) < sortedCorners(b);
        });
        ghost_.erase(std::unique(ghost_.begin(), ghost_.end(), equalSet), ghost_.end());
    }

    void findLeaves(uint32_t limit, size_t begin, size_t end, int level) {
        if (begin == end) return;
        const bool is_cell = partition_.shape() == CellShape::kTetrahedra || level % 3 == 0;
        if (!is_cell || (end - begin > limit && level < kMaxCellLevel)) {
            const CellId cell = cellAt(paths_[begin], level);
            const CellPath middle = firstPath(cellChild(cell, 1));
            const size_t split = size_t(std::lower_bound(paths_.begin() + ptrdiff_t(begin),
                                                         paths_.begin() + ptrdiff_t(end), middle) -
                                        paths_.begin());
            findLeaves(limit, begin, split, level + 1);
            findLeaves(limit, split, end, level + 1);
            return;
        }
        uint64_t occupied = 0;
        const int below = 61 - kOccupiedLevels - level;
        for (size_t i = begin; i < end && below >= 0; ++i)
            occupied |= uint64_t(1) << (paths_[i] >> below & 63);
        if (below < 0) occupied = ~uint64_t(0);
        out_.leaves.push_back({cellAt(paths_[begin], level), uint32_t(end - begin), occupied});
    }

    void locateVertices() {
        const int level = cellLevel(bucket_.cell);
        position_.resize(keys_.size());
        for (size_t v = 0; v < keys_.size(); ++v) position_[v] = latticePoint(keys_[v]);
        std::vector<CellPath> paths(keys_.size());
        if (partition_.shape() == CellShape::kCubes)
            std::transform(position_.begin(), position_.end(), paths.begin(),
                           [](const Vec3i& p) { return cubePath(p); });
        else
            cellPaths(position_, 1, paths, level);
        inside_.resize(keys_.size());
        for (size_t v = 0; v < keys_.size(); ++v)
            inside_[v] = cellAt(paths[v], level) == bucket_.cell;
    }

    size_t triangleTotal() { return mesh().triangle.size() + ghost_.size(); }
    const Triangle& triangleAt(size_t t) {
        const size_t own = mesh().triangle.size();
        return t < own ? mesh().triangle[t] : ghost_[t - own];
    }

    // Area-weighted, exact in integers, so the sum does not depend on the order.
    void sumNormals() {
        std::vector<Vec3l> sum(keys_.size(), Vec3l(0));
        for (size_t t = 0; t < triangleTotal(); ++t) {
            const Triangle& f = triangleAt(t);
            const Vec3l a(position_[f[0]]), b(position_[f[1]]), c(position_[f[2]]);
            const Vec3l n = crossInteger(b - a, c - a);
            for (uint32_t v : f) sum[v] += n;
        }
        for (size_t v = 0; v < own_vertices_; ++v) mesh().normal[v] = encodeSum(sum[v]);
        sendNormals(sum);
    }

    static OctNormal encodeSum(const Vec3l& sum) {
        const auto largest =
            std::max({std::abs(sum.x), std::abs(sum.y), std::abs(sum.z), int64_t(1)});
        return encodeNormal(Vec3f(Vec3d(sum) / double(largest)));
    }

    size_t homeOf(const Triangle& ghost) {
        return partition_.bucketOf(position_[ghost[0]], position_[ghost[1]], position_[ghost[2]]);
    }

    void sendNormals(const std::vector<Vec3l>& sum) {
        std::vector<std::pair<size_t, uint32_t>> told;
        for (const Triangle& f : ghost_) {
            const size_t home = homeOf(f);
            for (uint32_t v : f)
                if (inside_[v]) told.emplace_back(home, v);
        }
        std::sort(told.begin(), told.end());
        told.erase(std::unique(told.begin(), told.end()), told.end());
        for (const auto& [home, v] : told)
            out_.messages.push_back(
                {home, {keys_[v], Message::kVertex, std::bit_cast<uint32_t>(encodeSum(sum[v]))}});
    }

    struct HalfEdge {
        uint32_t other;     // the end with the larger id
        uint32_t triangle;  // own, then ghosts
        uint8_t edge;
        bool forward;
    };

    // Half-edges grouped by their smaller vertex id, then by the other.
    void classifyEdges() {
        const size_t total = triangleTotal();
        std::vector<uint32_t> start(keys_.size() + 1, 0);
        const auto forEach = [&](auto&& visit) {
            for (size_t t = 0; t < total; ++t) {
                const Triangle& f = triangleAt(t);
                for (uint8_t e = 0; e < 3; ++e) {
                    const uint32_t a = f[e], b = f[(e + 1) % 3];
                    visit(std::min(a, b), HalfEdge{std::max(a, b), uint32_t(t), e, a < b});
                }
            }
        };
        forEach([&](uint32_t v, const HalfEdge&) { ++start[v + 1]; });
        for (size_t v = 0; v < keys_.size(); ++v) start[v + 1] += start[v];
        std::vector<HalfEdge> half(3 * total);
        {
            std::vector<uint32_t> next(start.begin(), start.end() - 1);
            forEach([&](uint32_t v, const HalfEdge& h) { half[next[v]++] = h; });
        }
        mesh().edge_class.assign(mesh().triangle.size(), 0);
        LocalComponents components(mesh().triangle.size());
        for (size_t v = 0; v < keys_.size(); ++v) {
            const auto begin = half.begin() + start[v], end = half.begin() + start[v + 1];
            std::sort(begin, end, [](const HalfEdge& a, const HalfEdge& b) {
                return a.other != b.other ? a.other < b.other : a.triangle < b.triangle;
            });
            for (auto first = begin; first != end;) {
                auto last = first;
                while (last != end && last->other == first->other) ++last;
                const std::span<const HalfEdge> uses(first, last);
                const bool owned = inside_[keys_[v] < keys_[uses[0].other] ? v : uses[0].other];
                linkUses(uint32_t(v), uses, owned, components);
                if (owned) classifyEdge(uint32_t(v), uses);
                first = last;
            }
        }
        for (uint32_t t = 0; t < mesh().triangle.size(); ++t) {
            const Triangle& f = mesh().triangle[t];
            components.setVolume(t,
                                 sixfoldVolume(position_[f[0]], position_[f[1]], position_[f[2]]));
        }
        out_.bucket.components = components.finish();
    }

    // Own triangles hang together over the edge. Where others may use it too, the uses are told:
    // all that matter, as three are as good as any more.
    void linkUses(uint32_t v, std::span<const HalfEdge> uses, bool owned,
                  LocalComponents& components) {
        size_t own = uses.size();  // they come first
        while (own > 0 && uses[own - 1].triangle >= mesh().triangle.size()) --own;
        for (size_t i = 1; i < own; ++i) components.unite(uses[0].triangle, uses[i].triangle);
        if (own == uses.size() && owned) {
            if (own != 2 || uses[0].forward == uses[1].forward)
                components.markOpen(uses[0].triangle);
            return;
        }
        const auto [low, high] = std::minmax(keys_[v], keys_[uses[0].other]);
        for (size_t i = 0; i < std::min(own, size_t(3)); ++i)
            components.share(uses[i].triangle, low, high, uses[i].forward == (keys_[v] == low));
    }

    // Of an edge that this bucket owns.
    void classifyEdge(uint32_t v, std::span<const HalfEdge> uses) {
        const uint32_t w = uses[0].other;
        constexpr EdgeClass kByUses[] = {EdgeClass::kMany, EdgeClass::kBorder, EdgeClass::kManifold,
                                         EdgeClass::kTriple};
        const EdgeClass edge_class = uses.size() < 4 ? kByUses[uses.size()] : EdgeClass::kMany;
        if (edge_class == EdgeClass::kManifold) {
            out_.edges.inconsistent += uses[0].forward == uses[1].forward;
            return;
        }
        ++(edge_class == EdgeClass::kBorder ? out_.edges.border : out_.edges.non_manifold);
        for (const HalfEdge& h : uses) {
            if (h.triangle < mesh().triangle.size()) {
                mesh().edge_class[h.triangle] |= uint8_t(uint8_t(edge_class) << (2 * h.edge));
            } else {
                const auto [low, high] = std::minmax(keys_[v], keys_[w]);
                out_.messages.push_back(
                    {homeOf(triangleAt(h.triangle)), {low, high, uint32_t(edge_class)}});
            }
        }
    }

    /// The corner of a triangle at a vertex, by the others.
    struct Corner {
        uint32_t next, previous, triangle;
        uint8_t edge;  ///< from the vertex to `next`
    };

    // Vertices inside see all their triangles.
    void markIrregular() {
        std::vector<uint32_t> start(keys_.size() + 1, 0);
        for (size_t t = 0; t < triangleTotal(); ++t)
            for (const uint32_t v : triangleAt(t)) ++start[v + 1];
        for (size_t v = 0; v < keys_.size(); ++v) start[v + 1] += start[v];
        std::vector<Corner> corners(3 * triangleTotal());
        std::vector<uint32_t> next(start.begin(), start.end() - 1);
        for (uint32_t t = 0; t < triangleTotal(); ++t) {
            const Triangle& f = triangleAt(t);
            for (uint8_t k = 0; k < 3; ++k)
                corners[next[f[k]]++] = {f[(k + 1) % 3], f[(k + 2) % 3], t, k};
        }
        for (uint32_t v = 0; v < keys_.size(); ++v) {
            const std::span<Corner> fan(corners.data() + start[v], start[v + 1] - start[v]);
            if (inside_[v] && !isOneFan(fan)) markFans(v, fan);
        }
    }

    static bool isOneFan(std::span<const Corner> corners) {
        const auto count = [&](uint32_t w, uint32_t Corner::*side) {
            return std::count_if(corners.begin(), corners.end(),
                                 [&](const Corner& c) { return c.*side == w; });
        };
        size_t first = 0, open = 0;
        for (size_t i = 0; i < corners.size(); ++i) {
            if (count(corners[i].next, &Corner::next) > 1 ||
                count(corners[i].previous, &Corner::previous) > 1)
                return false;
            if (count(corners[i].next, &Corner::previous) == 0) first = i, ++open;
        }
        if (open > 1) return false;
        size_t reached = 1;
        for (uint32_t w = corners[first].previous; reached < corners.size(); ++reached) {
            const auto c = std::find_if(corners.begin(), corners.end(),
                                        [&](const Corner& c) { return c.next == w; });
            if (c == corners.end() || size_t(c - corners.begin()) == first) break;
            w = c->previous;
        }
        return reached == corners.size();
    }

    // Triangles that share a neighbour count as one fan here; each of them has an edge marked.
    void markFans(uint32_t v, std::span<Corner> corners) {
        std::sort(corners.begin(), corners.end(),
                  [&](const Corner& a, const Corner& b) { return keys_[a.next] < keys_[b.next]; });
        std::vector<uint8_t> reached(corners.size(), 0);
        for (size_t i = 0; i < corners.size(); ++i) {
            if (reached[i]) continue;
            const uint32_t w = corners[i].next;
            for (const Corner& c : corners) {
                if (c.next == w) setClass(v, w, c.triangle, c.edge);
                if (c.previous == w) setClass(v, w, c.triangle, uint8_t((c.edge + 2) % 3));
            }
            std::vector<uint32_t> joined{w};
            for (size_t k = 0; k < joined.size(); ++k)
                for (size_t j = 0; j < corners.size(); ++j) {
                    const Corner& c = corners[j];
                    if (reached[j] || (c.next != joined[k] && c.previous != joined[k])) continue;
                    reached[j] = 1;
                    joined.push_back(c.next);
                    joined.push_back(c.previous);
                }
        }
    }

    void setClass(uint32_t v, uint32_t w, uint32_t triangle, uint8_t edge) {
        if (triangle < mesh().triangle.size()) {
            mesh().edge_class[triangle] |= uint8_t(uint8_t(EdgeClass::kMany) << (2 * edge));
            return;
        }
        const auto [low, high] = std::minmax(keys_[v], keys_[w]);
        out_.messages.push_back(
            {homeOf(triangleAt(triangle)), {low, high, uint32_t(EdgeClass::kMany)}});
    }

    // Duplicates and ghosts may have left vertices that no own triangle uses; ghosts' come last,
    // and duplicates share all of theirs with the one that stays.
    void trim() {
        position_.resize(own_vertices_);
        mesh().position = std::move(position_);
        inside_.resize(own_vertices_);
        out_.bucket.is_inside = std::move(inside_);
    }

    const Partition& partition_;
    const Bucket& bucket_;
    const VertexRecord& record_;
    WeldedBucket out_;
    KeyMap ids_;
    std::vector<uint64_t> keys_;
    std::vector<Vec3i> position_;
    std::vector<uint8_t> inside_;
    std::vector<CellPath> paths_;
    std::vector<Triangle> ghost_;
    uint32_t own_vertices_ = 0;
};

}  // namespace

WeldedBucket weldBucket(const Partition& partition, size_t bucket, const VertexRecord& record,
                        uint32_t leaf_triangles, bool mark_irregular) {
    return Welder(partition, bucket, record).run(leaf_triangles, mark_irregular);
}

void applyMessages(std::span<const Message> messages, BucketMesh& bucket) {
    if (messages.empty()) return;
    Mesh& mesh = bucket.mesh;
    KeyMap vertex_of;
    for (size_t v = 0; v < mesh.position.size(); ++v)
        if (!bucket.is_inside[v]) vertex_of.insert(latticeKey(mesh.position[v]), uint32_t(v));
    struct Edge {
        uint32_t a, b, value;
        auto operator<=>(const Edge&) const = default;
    };
    std::vector<Edge> edges;
    std::vector<uint64_t> inside_needed;
    for (const Message& m : messages)
        if (m.b == Message::kVertex) {
            if (const uint32_t* v = vertex_of.find(m.a))
                mesh.normal[*v] = std::bit_cast<OctNormal>(m.value);
        } else {
            inside_needed.push_back(m.a);
            inside_needed.push_back(m.b);
        }
    if (inside_needed.empty()) return;
    std::sort(inside_needed.begin(), inside_needed.end());
    for (size_t v = 0; v < mesh.position.size(); ++v)
        if (bucket.is_inside[v]) {
            const uint64_t key = latticeKey(mesh.position[v]);
            if (std::binary_search(inside_needed.begin(), inside_needed.end(), key))
                vertex_of.insert(key, uint32_t(v));
        }
    for (const Message& m : messages) {
        if (m.b == Message::kVertex) continue;
        const uint32_t* a = vertex_of.find(m.a);
        const uint32_t* b = vertex_of.find(m.b);
        if (a && b) edges.push_back({std::min(*a, *b), std::max(*a, *b), m.value});
    }
    std::sort(edges.begin(), edges.end());
    std::vector<uint8_t> touched(mesh.position.size(), 0);
    for (const Edge& e : edges) touched[e.a] = touched[e.b] = 1;
    for (size_t t = 0; t < mesh.triangle.size(); ++t)
        for (size_t e = 0; e < 3; ++e) {
            const uint32_t a = mesh.triangle[t][e], b = mesh.triangle[t][(e + 1) % 3];
            if (!touched[a] || !touched[b]) continue;
            // The largest that was told, of here and there: kMany may come beside what is owned.
            auto found = std::upper_bound(edges.begin(), edges.end(),
                                          Edge{std::min(a, b), std::max(a, b), ~0u});
            if (found == edges.begin()) continue;
            if (--found; found->a != std::min(a, b) || found->b != std::max(a, b)) continue;
            const uint32_t here = mesh.edge_class[t] >> (2 * e) & 3u;
            mesh.edge_class[t] = uint8_t((mesh.edge_class[t] & ~(3u << (2 * e))) |
                                         std::max(here, found->value) << (2 * e));
        }
}

CellPath trianglePath(const Mesh& mesh, size_t triangle, CellShape shape) {
    const Triangle& f = mesh.triangle[triangle];
    return trianglePath(shape, mesh.position[f[0]], mesh.position[f[1]], mesh.position[f[2]]);
}

}  // namespace pietra
