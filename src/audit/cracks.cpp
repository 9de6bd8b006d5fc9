#include "audit/cracks.h"

#include <algorithm>
#include <bit>
#include <mutex>
#include <vector>

#include "base/hash.h"
#include "base/parallel.h"
#include "extmem/spill_table.h"
#include "geometry/lattice.h"

namespace pietra {

namespace {

constexpr uint64_t kTopBit = uint64_t(1) << 63;

/// One use of an edge. Lattice keys have 63 bits: the class fills the two left over.
struct EdgeUse {
    uint64_t a_and_class, b_and_class;
    EdgeUse() = default;
    EdgeUse(uint64_t a, uint64_t b, unsigned edge_class)
        : a_and_class(a | uint64_t(edge_class & 1) << 63),
          b_and_class(b | uint64_t(edge_class >> 1) << 63) {}
    EdgeKey key() const { return {a_and_class & ~kTopBit, b_and_class & ~kTopBit}; }
    unsigned edgeClass() const {
        return unsigned(a_and_class >> 63) | unsigned(b_and_class >> 63) << 1;
    }
    uint64_t hash() const {
        return mixBits(mixBits(a_and_class & ~kTopBit) + (b_and_class & ~kTopBit));
    }
    bool operator<(const EdgeUse& o) const {
        return std::pair(key(), edgeClass()) < std::pair(o.key(), o.edgeClass());
    }
};

/// A vertex of a patch; the top bit says that it is settled there.
struct VertexUse {
    uint64_t key_and_settled;
    uint64_t key() const { return key_and_settled & ~kTopBit; }
    bool settled() const { return key_and_settled & kTopBit; }
    uint64_t hash() const { return mixBits(key()); }
    bool operator<(const VertexUse& o) const {
        return std::pair(key(), settled()) < std::pair(o.key(), o.settled());
    }
};

/// How often an edge is used, and by whom.
struct Uses {
    uint32_t count = 0;
    unsigned class_mask = 0;  // bit c: somebody says EdgeClass(c)
    void add(unsigned edge_class) {
        ++count;
        class_mask |= 1u << edge_class;
    }
    bool only(EdgeClass c) const { return class_mask == 1u << unsigned(c); }
    bool isNonManifold() const {
        return class_mask & (1u << unsigned(EdgeClass::kTriple) | 1u << unsigned(EdgeClass::kMany));
    }
    /// Exactly as often as its class says; kMany never is, as there is no upper limit.
    bool isComplete() const {
        return (only(EdgeClass::kManifold) && count == 2) ||
               (only(EdgeClass::kTriple) && count == 3);
    }
    bool isBorder() const { return only(EdgeClass::kBorder) && count == 1; }
};

void judge(const Uses& uses, const EdgeKey& key, CrackReport& report) {
    ++report.edges;
    if (uses.isComplete()) return;
    if (uses.isBorder()) {
        ++report.border_edges;
        return;
    }
    if (uses.only(EdgeClass::kMany) && uses.count >= 4) return;
    const bool disagreed = std::popcount(uses.class_mask) > 1;
    if (disagreed) ++report.disagreeing_edges;
    if (uses.count == 1)
        ++report.cracked_edges;
    else if (uses.count > 2 && !uses.isNonManifold())
        ++report.overlapping_edges;
    else if (!disagreed)
        ++report.miscounted_edges;
    if (!report.first_fault || key < *report.first_fault) report.first_fault = key;
}

void merge(const CrackReport& part, CrackReport& sum) {
    sum.triangles += part.triangles;
    sum.edges += part.edges;
    sum.border_edges += part.border_edges;
    sum.cracked_edges += part.cracked_edges;
    sum.overlapping_edges += part.overlapping_edges;
    sum.miscounted_edges += part.miscounted_edges;
    sum.disagreeing_edges += part.disagreeing_edges;
    sum.degenerate_triangles += part.degenerate_triangles;
    if (part.first_fault && (!sum.first_fault || *part.first_fault < *sum.first_fault))
        sum.first_fault = part.first_fault;
}

/// The edges of one patch, sorted into lists by their end of lower key. Scratch, one a thread.
class PatchEdges {
public:
    /// What goes into the tables over the whole cut; what is complete here is judged into `report`.
    std::vector<EdgeUse> edges;
    std::vector<VertexUse> vertices;
    CrackReport report;

    void examine(const Mesh& patch, const SharedVertices& shared) {
        edges.clear();
        vertices.clear();
        report = {};
        weld(patch);
        listEdges(patch);
        markOpen(shared);
        emitOpen();
    }

private:
    struct HalfEdge {
        uint32_t upper;
        uint32_t edge_class;
        bool operator<(const HalfEdge& o) const { return upper < o.upper; }
    };

    /// Vertices of equal position (seams of attributes) become one point; points are in key order.
    void weld(const Mesh& patch) {
        sorted_.resize(patch.vertexCount());
        for (uint32_t v = 0; v < sorted_.size(); ++v)
            sorted_[v] = {latticeKey(patch.position[v]), v};
        std::sort(sorted_.begin(), sorted_.end());
        point_of_.resize(patch.vertexCount());
        keys_.clear();
        for (const auto& [key, v] : sorted_) {
            if (keys_.empty() || keys_.back() != key) keys_.push_back(key);
            point_of_[v] = uint32_t(keys_.size() - 1);
        }
    }

    template <class Visit>
    void forEachHalfEdge(const Mesh& patch, Visit&& visit) {
        for (size_t t = 0; t < patch.triangleCount(); ++t) {
            const Triangle& corners = patch.triangle[t];
            const std::array<uint32_t, 3> p = {point_of_[corners[0]], point_of_[corners[1]],
                                               point_of_[corners[2]]};
            if (p[0] == p[1] || p[1] == p[2] || p[2] == p[0]) continue;
            for (int k = 0; k < 3; ++k) {
                const uint32_t a = p[k], b = p[(k + 1) % 3];
                visit(std::min(a, b), std::max(a, b), uint32_t(patch.edgeClass(t, k)));
            }
        }
    }

    void listEdges(const Mesh& patch) {
        begin_.assign(keys_.size() + 1, 0);
        used_.assign(keys_.size(), 0);
        size_t half_edges = 0;
        forEachHalfEdge(patch, [&](uint32_t lower, uint32_t upper, uint32_t) {
            ++begin_[lower + 1];
            used_[lower] = used_[upper] = 1;
            ++half_edges;
        });
        report.triangles = patch.triangleCount();
        report.degenerate_triangles = patch.triangleCount() - half_edges / 3;
        for (size_t p = 0; p < keys_.size(); ++p) begin_[p + 1] += begin_[p];
        cursor_.assign(begin_.begin(), begin_.end() - 1);
        half_edges_.resize(half_edges);
        forEachHalfEdge(patch, [&](uint32_t lower, uint32_t upper, uint32_t edge_class) {
            half_edges_[cursor_[lower]++] = {upper, edge_class};
        });
        for (size_t p = 0; p < keys_.size(); ++p)
            std::sort(half_edges_.begin() + begin_[p], half_edges_.begin() + begin_[p + 1]);
    }

    /// visit(lower point, upper point, uses, the half-edges), once an edge.
    template <class Visit>
    void forEachEdge(Visit&& visit) {
        for (uint32_t lower = 0; lower < keys_.size(); ++lower)
            for (uint32_t i = begin_[lower]; i < begin_[lower + 1];) {
                const uint32_t first = i;
                Uses uses;
                for (; i < begin_[lower + 1] && half_edges_[i].upper == half_edges_[first].upper;
                     ++i)
                    uses.add(half_edges_[i].edge_class);
                visit(lower, half_edges_[first].upper, uses,
                      std::span(half_edges_).subspan(first, i - first));
            }
    }

    void emit(uint32_t lower, uint32_t upper, std::span<const HalfEdge> uses) {
        for (const HalfEdge& use : uses)
            edges.emplace_back(keys_[lower], keys_[upper], use.edge_class);
    }

    void markOpen(const SharedVertices& shared) {
        open_.assign(keys_.size(), shared.all);
        if (!shared.keys.empty())
            for (size_t p = 0; p < keys_.size(); ++p)
                open_[p] = std::binary_search(shared.keys.begin(), shared.keys.end(), keys_[p]);
        forEachEdge(
            [&](uint32_t lower, uint32_t upper, const Uses& uses, std::span<const HalfEdge>) {
                if (!uses.isComplete()) open_[lower] = open_[upper] = 1;
            });
    }

    void emitOpen() {
        forEachEdge([&](uint32_t lower, uint32_t upper, const Uses& uses,
                        std::span<const HalfEdge> half_edges) {
            if (open_[lower] && open_[upper])
                emit(lower, upper, half_edges);
            else
                judge(uses, {keys_[lower], keys_[upper]}, report);
        });
        for (size_t p = 0; p < keys_.size(); ++p)
            if (used_[p]) vertices.push_back({keys_[p] | (open_[p] ? 0 : kTopBit)});
    }

    std::vector<std::pair<uint64_t, uint32_t>> sorted_;
    std::vector<uint32_t> point_of_;  // of each vertex
    std::vector<uint64_t> keys_;      // of each point
    std::vector<uint32_t> begin_, cursor_;
    std::vector<HalfEdge> half_edges_;
    std::vector<uint8_t> used_, open_;
};

}  // namespace

struct CrackCounter::Tables {
    Tables(Budget& budget, size_t bytes, const std::string& temp_dir, SharedVertices known_shared)
        : known(std::move(known_shared)),
          max_found(bytes / 16 / sizeof(uint64_t)),
          edge_uses(budget, bytes / 2, temp_dir, "counting edges"),
          vertex_uses(budget, bytes / 2, temp_dir, "counting vertices") {}

    /// Vertices settled in one patch and present in another.
    void findShared();
    void judgeEdges(const BorderVisitor& on_border);

    const SharedVertices known;
    const size_t max_found;
    SharedVertices found;
    SpillTable<EdgeUse> edge_uses;
    SpillTable<VertexUse> vertex_uses;
    PerThread<PatchEdges> scratch;
    std::mutex mutex;
    CrackReport report;
};

void CrackCounter::Tables::findShared() {
    vertex_uses.forEachRun([&](std::span<const VertexUse> run) {
        std::vector<uint64_t> shared;
        for (size_t i = 0; i < run.size();) {
            const size_t first = i;
            bool settled = false;
            for (; i < run.size() && run[i].key() == run[first].key(); ++i)
                settled |= run[i].settled();
            if (settled && i - first > 1) shared.push_back(run[first].key());
        }
        const std::lock_guard lock(mutex);
        found.all |= found.keys.size() + shared.size() > max_found;
        if (found.all)
            found.keys.clear();
        else
            found.keys.insert(found.keys.end(), shared.begin(), shared.end());
    });
    std::sort(found.keys.begin(), found.keys.end());
}

void CrackCounter::Tables::judgeEdges(const BorderVisitor& on_border) {
    edge_uses.forEachRun([&](std::span<const EdgeUse> run) {
        CrackReport part;
        for (size_t i = 0; i < run.size();) {
            const EdgeKey key = run[i].key();
            Uses uses;
            for (; i < run.size() && run[i].key() == key; ++i) uses.add(run[i].edgeClass());
            judge(uses, key, part);
            if (on_border && uses.isBorder()) on_border(key);
        }
        const std::lock_guard lock(mutex);
        merge(part, report);
    });
}

CrackCounter::CrackCounter(Budget& budget, size_t memory_bytes, const std::string& temp_dir,
                           SharedVertices shared)
    : tables_(std::make_unique<Tables>(budget, memory_bytes, temp_dir, std::move(shared))) {}

CrackCounter::~CrackCounter() = default;

void CrackCounter::add(const Mesh& patch) {
    PatchEdges& local = tables_->scratch.local();
    local.examine(patch, tables_->known);
    tables_->edge_uses.append(local.edges);
    tables_->vertex_uses.append(local.vertices);
    const std::lock_guard lock(tables_->mutex);
    merge(local.report, tables_->report);
}

CrackReport CrackCounter::finish(const BorderVisitor& on_border) {
    tables_->findShared();
    tables_->report.exact = tables_->found.empty();
    tables_->judgeEdges(tables_->report.exact ? on_border : BorderVisitor());
    return tables_->report;
}

const SharedVertices& CrackCounter::sharedVertices() const {
    return tables_->found;
}

CrackReport countCracks(const PatchStream& stream, std::span<const NodeIndex> nodes, Budget& budget,
                        size_t memory_bytes, const std::string& temp_dir,
                        const BorderVisitor& on_border) {
    SharedVertices shared;
    for (;;) {
        CrackCounter counter(budget, memory_bytes, temp_dir, shared);
        stream(nodes, [&](NodeIndex, const Mesh& patch) { counter.add(patch); });
        const CrackReport report = counter.finish(on_border);
        // With all those vertices open, a second round is always exact.
        if (report.exact || !shared.empty()) return report;
        shared = counter.sharedVertices();
    }
}

}  // namespace pietra
