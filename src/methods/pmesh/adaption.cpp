#include "methods/pmesh/adaption.h"

#include <algorithm>
#include <atomic>
#include <bit>

#include "base/check.h"
#include "base/parallel.h"

namespace pietra::pmesh {
namespace {

enum State : uint8_t {
    kMarked = 1,  ///< needed, or needed by a neighbour
    kFresh0 = 2,  ///< marked, not looked at yet: in rounds of even, of odd number
    kFresh1 = 4,
    kMaySplit = 8,
    kMayUndo = 16,  ///< its last operation is not needed
};
constexpr size_t kBlockVertices = 4096;
/// Operations after which sorting may pay: what fits the second-level cache needs none.
constexpr size_t kLeastSort = 4096;
constexpr size_t kGrain = 256;  // operations
constexpr auto kRelaxed = std::memory_order_relaxed;

/// body(v) for each v of [begin, end) whose state has one of these bits, in order.
template <class Body>
void forStates(std::vector<uint64_t>& states, size_t begin, size_t end, uint8_t bits, Body&& body) {
    const uint64_t mask = 0x0101010101010101u * bits;
    for (size_t word = begin / 8; word < (end + 7) / 8; ++word) {
        uint64_t found = std::atomic_ref(states[word]).load(kRelaxed) & mask;
        while (found != 0) {
            const int k = std::countr_zero(found) / 8;
            body(uint32_t(8 * word + size_t(k)));
            found &= ~(uint64_t(0xff) << (8 * k));
        }
    }
}

}  // namespace

/// Calls body(block, begin, end) for all blocks, in parallel.
template <class Body>
void Adaption::forBlocks(Body&& body) {
    const size_t count = mesh_.vertexCount();
    parallelFor(block_.size(), [&](size_t b) {
        const size_t begin = b * kBlockVertices;
        body(block_[b], begin, std::min(begin + kBlockVertices, count));
    });
}

/// Calls body(v, star) for all of these, in order.
template <class Body>
void Adaption::forStars(std::span<const uint32_t> vertices, Body&& body) const {
    std::array<Star, ActiveMesh::kTogether> stars;
    for (size_t begin = 0; begin < vertices.size(); begin += stars.size()) {
        const auto some = vertices.subspan(begin, std::min(stars.size(), vertices.size() - begin));
        mesh_.gatherStars(some, stars.data(),
                          [&](uint32_t w) { __builtin_prefetch(&mesh_.pulse[w]); });
        for (size_t i = 0; i < some.size(); ++i) body(some[i], stars[i]);
    }
}

PassCounts Adaption::pass(const Criterion& criterion) {
    ++mesh_.time;
    blocker_.resize(mesh_.vertexCount());
    mark(criterion);
    for (uint32_t round = 0; isFresh(round); round ^= 1) force(round);
    findMerges(criterion);
    listWork();
    applyWork();
    const PassCounts counts{uint32_t(split_.size()), uint32_t(merge_.size())};
    since_sort_ += counts.operations();
    if (since_sort_ > std::max(kLeastSort, mesh_.vertexCount())) {
        mesh_.sortInSpace();
        since_sort_ = 0;
    }
    return counts;
}

int Adaption::settle(const Criterion& criterion) {
    int passes = 1;
    while (pass(criterion).operations() > 0) ++passes;
    return passes;
}

void Adaption::mark(const Criterion& criterion) {
    block_.resize((mesh_.vertexCount() + kBlockVertices - 1) / kBlockVertices);
    states_.resize((mesh_.vertexCount() + 7) / 8);
    forBlocks([&](Block& block, size_t begin, size_t end) {
        uint64_t any = 0;
        for (size_t v = begin; v < end; v += 8) {
            uint64_t eight = 0;
            for (size_t k = 0; k < std::min<size_t>(8, end - v); ++k) {
                const Vertex& vertex = mesh_.vertex[v + k];
                const VertexCriteria& criteria = mesh_.criteria[v + k];
                const uint64_t marked =
                    criterion.needsSplit(vertex, criteria) ? kMarked | kFresh0 : 0;
                const uint64_t undo = criterion.needsLast(vertex, criteria) ? 0 : kMayUndo;
                eight |= (marked | undo) << (8 * k);
            }
            states_[v / 8] = eight;
            any |= eight;
        }
        constexpr uint64_t kEach = 0x0101010101010101u;
        block.fresh = {(any & kEach * kFresh0) != 0, false};
        block.may_undo = (any & kEach * kMayUndo) != 0;
        block.may_split = false;
        block.merge.clear();
    });
}

bool Adaption::isFresh(uint32_t round) const {
    return std::any_of(block_.begin(), block_.end(),
                       [&](const Block& block) { return block.fresh[round]; });
}

void Adaption::force(uint32_t round) {
    const uint8_t fresh = round == 0 ? kFresh0 : kFresh1;
    forBlocks([&](Block& block, size_t begin, size_t end) {
        if (!block.fresh[round]) return;
        block.fresh[round] = false;
        block.open.clear();
        forStates(states_, begin, end, fresh, [&](uint32_t v) {
            clearState(v, fresh);
            if (isBlocked(v, kMarked)) {
                markForced(blocker_[v].by, round ^ 1);
            } else {
                block.open.push_back(v);
            }
        });
        forStars(block.open, [&](uint32_t v, const Star& star) {
            if (!forceAround(v, star, round ^ 1)) return;
            setState(v, kMaySplit);
            block.may_split = true;
        });
    });
}

/// True if v may split; else marks those that must before it.
bool Adaption::forceAround(uint32_t v, const Star& star, uint32_t next_round) {
    const uint16_t level = mesh_.pulse[v].next_level;
    uint32_t lowest = v;
    mesh_.allNeighbours(v, star, [&](uint32_t w) {
        const uint16_t other = mesh_.pulse[w].next_level;
        DCHECK(other != level || level == kLeafLevel);
        if (other < level) markForced(w, next_round);
        if (other < mesh_.pulse[lowest].next_level) lowest = w;
        return true;
    });
    if (lowest == v) return true;
    blocker_[v] = {lowest, mesh_.time, kMarked};
    return false;
}

/// To be visited in `round`, the next one.
void Adaption::markForced(uint32_t w, uint32_t round) {
    if (stateOf(w) & kMarked) return;
    setState(w, kMarked | (round == 0 ? kFresh0 : kFresh1));
    std::atomic_ref(block_[w / kBlockVertices].fresh[round]).store(true, kRelaxed);
}

void Adaption::findMerges(const Criterion& criterion) {
    forBlocks([&](Block& block, size_t begin, size_t end) {
        if (!block.may_undo) return;
        block.open.clear();
        forStates(states_, begin, end, kMayUndo, [&](uint32_t u) {
            if (!(stateOf(u) & kMarked) && !isBlocked(u, kMayUndo)) block.open.push_back(u);
        });
        std::vector<uint32_t> others;
        forStars(block.open, [&](uint32_t u, const Star& star) {
            const bool dummy = operationBefore(u).isDummy();
            uint32_t v = dummy ? u : kNoCorner;
            if (!allowsMerge(u, star, u, v)) return;
            CHECK_NE(v, kNoCorner);  // or it has split again, and a neighbour has that level
            const Operation& o = operationBefore(u);
            const Vec3i centre = mesh_.vertex[v].position() - o.offset(0);
            if ((stateOf(v) & kMarked) || criterion.needs(centre, o.error, o.radius)) return;
            block.merge.push_back({v, u});
            others.push_back(v);
        });
        size_t i = 0, kept = 0;
        forStars(others, [&](uint32_t v, const Star& star) {
            Merge& merge = block.merge[i++];
            if (allowsMerge(v, star, merge.u, merge.v)) block.merge[kept++] = merge;
        });
        block.merge.resize(kept);
    });
}

/// Whether the neighbours of an end of the operation that made u allow to undo it. Finds v.
bool Adaption::allowsMerge(uint32_t end, const Star& star, uint32_t u, uint32_t& v) {
    const uint16_t level = mesh_.pulse[u].last_level;
    return mesh_.allNeighbours(end, star, [&](uint32_t w) {
        if (w == u) return true;
        const uint16_t other = mesh_.pulse[w].last_level;
        if (other == level) return v = w, true;
        if (other > level) {
            blocker_[u] = {w, mesh_.time, kMayUndo};
            return false;
        }
        return !(stateOf(w) & kMarked);
    });
}

/// The work of all blocks in the order of the vertices, with places for what is new.
void Adaption::listWork() {
    split_.clear();
    merge_.clear();
    uint32_t u = uint32_t(mesh_.vertexCount()), face = uint32_t(mesh_.faceCount());
    for (size_t b = 0; b < block_.size(); ++b) {
        const Block& block = block_[b];
        merge_.insert(merge_.end(), block.merge.begin(), block.merge.end());
        if (!block.may_split) continue;
        const size_t begin = b * kBlockVertices;
        const size_t end = std::min(begin + kBlockVertices, mesh_.vertexCount());
        forStates(states_, begin, end, kMaySplit, [&](uint32_t v) {
            const Operation& o = mesh_.source().operation[mesh_.record[v].next];
            split_.push_back({v, u, face});
            if (o.isDummy()) return;
            ++u;
            face += (o.rankLeft() != kNoRank) + (o.rankRight() != kNoRank);
        });
    }
    mesh_.resize(u, face);
}

/// What an operation between `id` and those after or before it reads, but for the star.
void Adaption::prefetch(uint32_t v, OperationId id) const {
    __builtin_prefetch(&mesh_.source().operation[id]);
    __builtin_prefetch(&mesh_.vertex[v], 1);
    __builtin_prefetch(&mesh_.criteria[v], 1);
    __builtin_prefetch(&mesh_.pulse[v], 1);
}

void Adaption::applySplits(std::span<const Split> splits) {
    std::array<uint32_t, ActiveMesh::kTogether> vertices;
    std::array<Star, ActiveMesh::kTogether> stars;
    for (size_t i = 0; i < splits.size(); ++i) {
        vertices[i] = splits[i].v;
        prefetch(splits[i].v, mesh_.record[splits[i].v].next);
    }
    mesh_.gatherStars({vertices.data(), splits.size()}, stars.data(),
                      [&](uint32_t w) { __builtin_prefetch(&mesh_.record[w]); });
    for (const Split& s : splits)
        for (const OperationId child : mesh_.source().operation[mesh_.record[s.v].next].child)
            if (child != kNoOperation) __builtin_prefetch(&mesh_.source().operation[child]);
    for (size_t i = 0; i < splits.size(); ++i) {
        const Split& s = splits[i];
        if (mesh_.source().operation[mesh_.record[s.v].next].isDummy()) {
            mesh_.move(s.v);
        } else {
            CHECK(mesh_.orient(stars[i]));
            mesh_.split(s.v, stars[i], s.u, s.face);
        }
    }
}

/// `first`: the place of the first of these in the list.
void Adaption::applyMerges(std::span<const Merge> merges, size_t first) {
    std::array<uint32_t, ActiveMesh::kTogether> vertices;
    std::array<Star, ActiveMesh::kTogether> stars;
    for (size_t i = 0; i < merges.size(); ++i) {
        vertices[i] = merges[i].u;
        prefetch(merges[i].v, mesh_.record[merges[i].u].last);
        __builtin_prefetch(&mesh_.record[merges[i].v]);
    }
    mesh_.gatherStars({vertices.data(), merges.size()}, stars.data(), [&](uint32_t) {});
    for (const Merge& m : merges) {
        const OperationId before = mesh_.record[m.u].undo_last;
        if (before != kNoOperation) __builtin_prefetch(&mesh_.source().operation[before]);
    }
    for (size_t i = 0; i < merges.size(); ++i) {
        const auto [v, u] = merges[i];
        std::array<uint32_t, 2> faces{kNoCorner, kNoCorner};
        if (u == v) {
            mesh_.moveBack(v);
        } else {
            faces = mesh_.merge(v, u);
        }
        free_vertex_[first + i] = u == v ? kNoCorner : u;
        free_face_[2 * (first + i)] = faces[0];
        free_face_[2 * (first + i) + 1] = faces[1];
    }
}

void Adaption::applyWork() {
    static constexpr size_t kTogether = ActiveMesh::kTogether;
    const auto forSome = [](const auto& list, auto&& body) {
        parallelForSlices(list.size(), kGrain, [&](size_t begin, size_t end) {
            for (; begin < end; begin += kTogether)
                body(std::span(list).subspan(begin, std::min(kTogether, end - begin)), begin);
        });
    };
    forSome(split_, [&](std::span<const Split> splits, size_t) { applySplits(splits); });
    if (merge_.empty()) return;
    free_vertex_.resize(merge_.size());
    free_face_.resize(2 * merge_.size());
    forSome(merge_, [&](std::span<const Merge> m, size_t first) { applyMerges(m, first); });
    std::erase(free_vertex_, kNoCorner);
    std::erase(free_face_, kNoCorner);
    mesh_.fillHoles(free_vertex_, free_face_);
}

}  // namespace pietra::pmesh
