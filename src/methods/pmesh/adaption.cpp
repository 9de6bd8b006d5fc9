#include "methods/pmesh/adaption.h"

#include <algorithm>
#include <atomic>

#include "base/check.h"
#include "base/parallel.h"

namespace pietra::pmesh {
namespace {

/// Operations after which sorting may pay: what fits the second-level cache needs none.
constexpr size_t kLeastSort = 4096;
constexpr size_t kGrain = 256;  // operations
constexpr size_t kTogether = ActiveMesh::kTogether;

/// body(some, first) for at most kTogether consecutive elements at a time, in parallel.
template <class T, class Body>
void forSome(std::vector<T>& list, Body&& body) {
    const auto slice = [&](size_t begin, size_t end) {
        for (; begin < end; begin += kTogether)
            body(std::span(list).subspan(begin, std::min(kTogether, end - begin)), begin);
    };
    if (list.size() <= kGrain) return slice(0, list.size());
    parallelForSlices(list.size(), kGrain, slice);
}

}  // namespace

PassCounts Adaption::frame(const Criterion& criterion, int most_passes) {
    criterion_ = criterion;
    scan();
    PassCounts all;
    for (int pass = 0; pass < most_passes; ++pass) {
        findSplits();
        findMerges();
        if (split_.empty() && merge_.empty()) break;
        apply();
        all.splits += uint32_t(split_.size());
        all.merges += uint32_t(merge_.size());
        ++all.passes;
    }
    tidy();
    since_sort_ += all.operations();
    if (since_sort_ > std::max(kLeastSort, mesh_.vertexCount())) {
        mesh_.sortInSpace();
        since_sort_ = 0;
    }
    return all;
}

void Adaption::scan() {
    const size_t count = mesh_.vertexCount();
    for (VertexSet* set : {&marked_, &fresh_, &may_split_, &may_merge_, &look_for_other_}) {
        set->clear();
        set->resize(count);
    }
    parallelForSlices(marked_.words(), 64, [&](size_t begin, size_t end) {
        for (size_t w = begin; w < end; ++w) {
            uint64_t split = 0, merge = 0;
            const size_t first = 64 * w, some = std::min<size_t>(64, count - first);
            for (size_t k = 0; k < some; ++k) {
                const Vertex& v = mesh_.vertex[first + k];
                const VertexCriteria& c = mesh_.criteria[first + k];
                split |= uint64_t(criterion_.needsSplit(v, c)) << k;
                merge |= uint64_t(!criterion_.needsLast(v, c)) << k;
            }
            marked_.insertWord(w, split);
            fresh_.insertWord(w, split);
            may_merge_.insertWord(w, merge);
        }
    });
}

void Adaption::findSplits() {
    for (fresh_.take(list_); !list_.empty(); fresh_.take(list_))
        forSome(list_, [&](std::span<const uint32_t> some, size_t) {
            std::array<Star, kTogether> stars;
            mesh_.gatherStars(some, stars.data(),
                              [&](uint32_t w) { __builtin_prefetch(&mesh_.pulse[w]); });
            for (size_t i = 0; i < some.size(); ++i) forceAround(some[i], stars[i]);
        });
    may_split_.take(list_);
    placeSplits();
}

/// Marks those that must split before v; if there are none, v may.
void Adaption::forceAround(uint32_t v, const Star& star) {
    const uint16_t level = mesh_.pulse[v].next_level;
    uint32_t lowest = v;
    mesh_.allNeighbours(v, star, [&](uint32_t w) {
        const uint16_t other = mesh_.pulse[w].next_level;
        DCHECK(other != level || level == kLeafLevel);
        if (other < level && marked_.insert(w)) fresh_.insert(w);
        if (other < mesh_.pulse[lowest].next_level) lowest = w;
        return true;
    });
    if (lowest == v) {
        may_split_.insert(v);
    } else {
        block(v, lowest, kSplit);
        setBlockedInAllViews(v, false);
    }
}

void Adaption::block(uint32_t v, uint32_t by, Blocked what) {
    if (mesh_.pulse[v].blocker != VertexPulse::kNoBlocker && what == kSplit &&
        mesh_.record[v].blocked == kMergeOfOther)
        look_for_other_.insert(v);
    mesh_.pulse[v].blocker = mesh_.pulse[by].name;
    mesh_.record[v].blocked = what;
}

/// The operation that made u must not be undone until what hinders it changes.
void Adaption::setBlockedInAllViews(uint32_t u, bool blocked) {
    uint16_t& radius = mesh_.criteria[u].merge_radius;
    radius = blocked ? radius | VertexCriteria::kBlocked
                     : radius & uint16_t(~VertexCriteria::kBlocked);
}

/// The one of this name changes.
void Adaption::wake(uint32_t v, uint32_t name) {
    const std::atomic_ref blocker(mesh_.pulse[v].blocker);
    if (blocker.load(std::memory_order_relaxed) != name) return;
    blocker.store(VertexPulse::kNoBlocker, std::memory_order_relaxed);
    switch (mesh_.record[v].blocked) {
        case kSplit:
            if (marked_.contains(v)) fresh_.insert(v);
            break;
        case kMerge:
            setBlockedInAllViews(v, false);
            if (!criterion_.needsLast(mesh_.vertex[v], mesh_.criteria[v])) may_merge_.insert(v);
            break;
        default: look_for_other_.insert(v);
    }
}

void Adaption::findOthers() {
    look_for_other_.take(list_);
    for (const uint32_t v : list_) {
        const uint16_t level = mesh_.pulse[v].last_level;
        mesh_.allNeighbours(v, [&](uint32_t u) {
            if (mesh_.pulse[u].last_level != level || level == 0) return true;
            if (mesh_.record[u].blocked == kSplit) return false;
            setBlockedInAllViews(u, false);
            mesh_.pulse[u].blocker = VertexPulse::kNoBlocker;
            if (!criterion_.needsLast(mesh_.vertex[u], mesh_.criteria[u])) may_merge_.insert(u);
            return false;
        });
    }
}

void Adaption::findMerges() {
    findOthers();
    may_merge_.take(list_);
    merge_.resize(list_.size());
    forSome(list_, [&](std::span<const uint32_t> some, size_t first) {
        findMerges(some, std::span(merge_).subspan(first, some.size()));
    });
    std::erase_if(merge_, [](const Merge& merge) { return merge.v == kNoCorner; });
}

void Adaption::findMerges(std::span<const uint32_t> candidates, std::span<Merge> merges) {
    std::array<uint32_t, kTogether> ends;
    std::array<size_t, kTogether> of;
    std::array<Star, kTogether> stars;
    size_t count = 0;
    for (const uint32_t u : candidates)
        __builtin_prefetch(&mesh_.source().operation[mesh_.record[u].last]);
    for (size_t i = 0; i < candidates.size(); ++i) {
        const uint32_t u = candidates[i];
        merges[i] = {kNoCorner, u, {kNoCorner, kNoCorner}};
        const Operation& o = mesh_.source().operation[mesh_.record[u].last];
        const Vec3i centre = mesh_.vertex[u].position() - o.offset(o.isDummy() ? 0 : 1);
        if (marked_.contains(u) || criterion_.needs(centre, o.error, o.radius)) continue;
        if (o.isDummy()) merges[i].v = u;
        of[count] = i;
        ends[count++] = u;
    }
    for (int at_u = 1; at_u >= 0; --at_u) {
        mesh_.gatherStars({ends.data(), count}, stars.data(),
                          [&](uint32_t w) { __builtin_prefetch(&mesh_.pulse[w]); });
        size_t kept = 0;
        for (size_t j = 0; j < count; ++j) {
            Merge& merge = merges[of[j]];
            if (allowsMerge(ends[j], stars[j], merge.u, merge.v)) {
                CHECK_NE(merge.v, kNoCorner);  // or it has split again, and a neighbour's is later
                of[kept] = of[j];
                ends[kept++] = merge.v;
            } else {
                merge.v = kNoCorner;
            }
        }
        count = kept;
    }
}

/// Whether the neighbours of an end of the operation that made u allow to undo it. Finds v.
bool Adaption::allowsMerge(uint32_t end, const Star& star, uint32_t u, uint32_t& v) {
    const uint16_t level = mesh_.pulse[u].last_level;
    return mesh_.allNeighbours(end, star, [&](uint32_t w) {
        if (w == u) return true;
        const uint16_t other = mesh_.pulse[w].last_level;
        if (other > level || marked_.contains(w)) {
            block(u, end == u ? w : end, kMerge);
            if (end != u) block(end, w, kMergeOfOther);
            setBlockedInAllViews(u, other > level);
            return false;
        }
        if (other == level) v = w;
        return true;
    });
}

/// Free places first, then the arrays' ends.
void Adaption::placeSplits() {
    const size_t count = list_.size(), vertices = mesh_.vertexCount(), faces = mesh_.faceCount();
    split_.resize(count);
    const auto place = [](const std::vector<uint32_t>& free, size_t i, size_t end) {
        return i < free.size() ? free[i] : uint32_t(end + i - free.size());
    };
    for (size_t i = 0; i < count; ++i)
        split_[i] = {list_[i],
                     place(free_vertex_, i, vertices),
                     {place(free_face_, 2 * i, faces), place(free_face_, 2 * i + 1, faces)}};
}

/// What an operation between `id` and those after or before it reads, but for the star.
void Adaption::prefetch(uint32_t v, OperationId id) const {
    __builtin_prefetch(&mesh_.source().operation[id]);
    __builtin_prefetch(&mesh_.vertex[v], 1);
    __builtin_prefetch(&mesh_.criteria[v], 1);
}

void Adaption::markIfNeeded(uint32_t v) {
    if (criterion_.needsSplit(mesh_.vertex[v], mesh_.criteria[v])) {
        marked_.insert(v);
        fresh_.insert(v);
    } else {
        marked_.erase(v);
    }
}

void Adaption::wakeAround(uint32_t v, const Star& star, uint32_t name) {
    mesh_.allNeighbours(v, star, [&](uint32_t w) { return wake(w, name), true; });
}

/// Sets places that are not used to kNoCorner.
void Adaption::applySplits(std::span<Split> splits) {
    const std::vector<Operation>& operation = mesh_.source().operation;
    std::array<uint32_t, kTogether> vertices;
    std::array<Star, kTogether> stars;
    for (size_t i = 0; i < splits.size(); ++i) {
        vertices[i] = splits[i].v;
        prefetch(splits[i].v, mesh_.record[splits[i].v].next);
    }
    mesh_.gatherStars({vertices.data(), splits.size()}, stars.data(),
                      [&](uint32_t w) { __builtin_prefetch(&mesh_.pulse[w]); });
    for (const Split& s : splits)
        for (const OperationId child : operation[mesh_.record[s.v].next].child)
            if (child != kNoOperation) __builtin_prefetch(&operation[child]);
    for (size_t i = 0; i < splits.size(); ++i) {
        Split& s = splits[i];
        const Operation& o = operation[mesh_.record[s.v].next];
        wakeAround(s.v, stars[i], mesh_.pulse[s.v].name);
        if (o.isDummy()) {
            mesh_.move(s.v);
            s = {s.v, kNoCorner, {kNoCorner, kNoCorner}};
        } else {
            CHECK(mesh_.orient(stars[i]));
            mesh_.split(s.v, stars[i], s.u, s.face);
            markIfNeeded(s.u);
            if (o.rankLeft() == kNoRank || o.rankRight() == kNoRank) s.face[1] = kNoCorner;
        }
        markIfNeeded(s.v);
    }
}

void Adaption::applyMerges(std::span<Merge> merges) {
    std::array<uint32_t, kTogether> vertices;
    std::array<Star, kTogether> stars;
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
    for (Merge& m : merges) applyMerge(m);
}

void Adaption::applyMerge(Merge& m) {
    const uint32_t name = mesh_.pulse[m.v].name, other = mesh_.pulse[m.u].name;
    if (m.u == m.v) {
        mesh_.moveBack(m.v);
        m.u = kNoCorner;
    } else {
        m.face = mesh_.merge(m.v, m.u);
    }
    mesh_.allNeighbours(m.v, [&](uint32_t w) {
        wake(w, name);
        wake(w, other);
        return true;
    });
    if (!criterion_.needsLast(mesh_.vertex[m.v], mesh_.criteria[m.v])) may_merge_.insert(m.v);
}

void Adaption::apply() {
    const size_t splits = split_.size();
    const auto beyond = [](size_t wanted, const std::vector<uint32_t>& free) {
        return wanted - std::min(wanted, free.size());
    };
    mesh_.resize(mesh_.vertexCount() + beyond(splits, free_vertex_),
                 mesh_.faceCount() + beyond(2 * splits, free_face_));
    for (VertexSet* set : {&marked_, &fresh_, &may_split_, &may_merge_, &look_for_other_})
        set->resize(mesh_.vertexCount());
    const std::vector<Split> places = split_;
    forSome(split_, [&](std::span<Split> some, size_t) { applySplits(some); });
    forSome(merge_, [&](std::span<Merge> some, size_t) { applyMerges(some); });

    free_vertex_.erase(free_vertex_.begin(),
                       free_vertex_.begin() + ptrdiff_t(std::min(splits, free_vertex_.size())));
    free_face_.erase(free_face_.begin(),
                     free_face_.begin() + ptrdiff_t(std::min(2 * splits, free_face_.size())));
    for (size_t i = 0; i < splits; ++i) {
        if (split_[i].u == kNoCorner) free_vertex_.push_back(places[i].u);
        for (const size_t k : {0, 1})
            if (split_[i].face[k] == kNoCorner) free_face_.push_back(places[i].face[k]);
    }
    for (const Merge& m : merge_) {
        if (m.u != kNoCorner) free_vertex_.push_back(m.u);
        for (const uint32_t f : m.face)
            if (f != kNoCorner) free_face_.push_back(f);
    }
}

/// No place is left free.
void Adaption::tidy() {
    findOthers();
    if (!free_vertex_.empty() || !free_face_.empty()) mesh_.fillHoles(free_vertex_, free_face_);
    free_vertex_.clear();
    free_face_.clear();
}

}  // namespace pietra::pmesh
