#include "methods/pmesh/adaption.h"

#include <algorithm>
#include <bit>

#include "base/check.h"
#include "base/parallel.h"
#include "base/stopwatch.h"
#include "methods/pmesh/criterion_scan.h"

namespace pietra::pmesh {
namespace {

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

PassCounts Adaption::frame(const Criterion& criterion, const FrameLimits& limits) {
    const Stopwatch watch;
    const uint32_t refused_before = refused_;
    criterion_ = criterion;
    if (wear_.takeIfOver(mesh_.vertexCount())) mesh_.sortInSpace();
    scan();
    PassCounts all;
    for (bool last = false; !last;) {
        last = int(all.passes) + 1 >= limits.passes || watch.ms() >= limits.milliseconds;
        findSplits(limits);
        merge_.clear();
        if (split_.empty() || last) findMerges(limits.operations);
        all.finished = split_.empty() && merge_.empty() && may_merge_.empty();
        if (all.finished) break;
        apply();
        all.splits += uint32_t(split_.size());
        all.merges += uint32_t(merge_.size());
        ++all.passes;
    }
    all.short_of_room = short_of_room_;
    // What does not fit is found again in each frame.
    all.merges -= std::min(all.merges, refused_ - refused_before);
    listWaiting();
    tidy();
    wear_.add(all.operations());
    return all;
}

void Adaption::scan() {
    const size_t count = mesh_.vertexCount();
    for (VertexSet* set : {&marked_, &fresh_, &may_split_, &released_, &may_merge_, &unknown_}) {
        set->clear();
        set->resize(count);
    }
    const auto slice = [&](size_t begin, size_t end) {
        for (size_t w = begin; w < end; ++w) {
            const size_t first = 64 * w;
            auto [split, merge] =
                scanVertices(criterion_, &mesh_.vertex[first], &mesh_.criteria[first],
                             std::min<size_t>(64, count - first));
            if (split != 0) split = withoutProvisional(w, split);
            marked_.insertWord(w, split);
            fresh_.insertWord(w, split);
            may_merge_.insertWord(w, merge);
        }
    };
    constexpr size_t kShared = 1 << 17;  // vertices; below, to wake others takes longer
    if (count < kShared) return slice(0, marked_.words());
    parallelForSlices(marked_.words(), 64, slice);
}

/// Of vertices 64 w and on: what criteria that are only a reference's need is not needed yet, but
/// to be loaded.
uint64_t Adaption::withoutProvisional(size_t w, uint64_t needed) {
    for (uint64_t bits = needed; bits != 0; bits &= bits - 1) {
        const uint32_t v = uint32_t(64 * w + size_t(std::countr_zero(bits)));
        if (!mesh_.record[v].provisional) continue;
        if (mesh_.record[v].provisional == VertexRecord::kRefused) {
            needed &= ~(bits & (0 - bits));
            continue;
        }
        const bool is_loaded = mesh_.isNextLoaded(v);
        if (is_loaded) {
            mesh_.updateCriteria(v);
        } else {
            unknown_.insert(v);
        }
        if (!is_loaded || !criterion_.needsSplit(mesh_.vertex[v], mesh_.criteria[v]))
            needed &= ~(bits & (0 - bits));
    }
    return needed;
}

void Adaption::gather(Some vertices, Star* stars) const {
    mesh_.gatherStars(vertices, stars, [&](uint32_t w) { __builtin_prefetch(&mesh_.pulse[w]); });
}

void Adaption::mark(uint32_t v) {
    if (marked_.insert(v)) fresh_.insert(v);
}

void Adaption::maySplit(uint32_t v) {
    if (mesh_.isNextLoaded(v) && mesh_.record[v].provisional != VertexRecord::kRefused)
        may_split_.insert(v);
}

/// Leaves the list's elements from there on for the next pass.
void Adaption::postpone(size_t from, VertexSet& set) {
    for (size_t i = from; i < list_.size(); ++i) set.insert(list_[i]);
    list_.resize(std::min(from, list_.size()));
}

void Adaption::findSplits(const FrameLimits& limits) {
    for (fresh_.take(list_); !list_.empty(); fresh_.take(list_))
        forSome(list_, [&](Some some, size_t) { findSplits(some); });
    may_split_.take(list_);
    const size_t used = mesh_.vertexCount() - free_vertex_.size();
    const size_t room = limits.vertices - std::min(limits.vertices, used);
    short_of_room_ = list_.size() > room;
    postpone(std::min(room, limits.operations), may_split_);
    placeSplits();
}

/// Marks those that must split before; where there are none, a vertex may.
void Adaption::findSplits(Some fresh) {
    std::array<uint32_t, kTogether> waiting;
    std::array<Star, kTogether> stars;
    size_t count = 0;
    for (const uint32_t v : fresh) __builtin_prefetch(&mesh_.pulse[v]);
    for (const uint32_t v : fresh) {
        if (mesh_.pulse[v].lower() == 0) {
            maySplit(v);
        } else {
            waiting[count++] = v;
        }
    }
    gather({waiting.data(), count}, stars.data());
    for (size_t i = 0; i < count; ++i) {
        const uint16_t level = mesh_.pulse[waiting[i]].next_level;
        const auto force = [&](uint32_t w) {
            if (mesh_.pulse[w].next_level < level) mark(w);
            return true;
        };
        if (stars[i].count == 0) {
            mesh_.allNeighbours(waiting[i], force);
        } else {
            for (const uint32_t w : stars[i].ring()) force(w);
        }
    }
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

/// Of those released: the u of their last operation.
void Adaption::findCandidates() {
    released_.take(list_);
    forSome(list_, [&](Some some, size_t) {
        prefetchOtherEnds(some);
        for (uint32_t u : some) {
            if (!mesh_.isNewEnd(u)) u = mesh_.otherEnd(u);
            if (mesh_.canUndo(u)) may_merge_.insert(u);
        }
    });
}

void Adaption::setBlocked(uint32_t u, bool blocked) {
    uint16_t& radius = mesh_.criteria[u].merge_radius;
    radius =
        blocked ? radius | VertexCriteria::kBlocked : radius & uint16_t(~VertexCriteria::kBlocked);
}

void Adaption::prefetchOtherEnds(Some vertices) const {
    for (const uint32_t v : vertices) {
        __builtin_prefetch(&mesh_.pulse[v]);
        __builtin_prefetch(&mesh_.record[v]);
        __builtin_prefetch(&mesh_.criteria[v], 1);
        __builtin_prefetch(&mesh_.vertex[v]);
    }
    for (const uint32_t v : vertices) __builtin_prefetch(&mesh_.face[mesh_.pulse[v].corner >> 2]);
    for (const uint32_t v : vertices)
        for (const uint32_t w : mesh_.face[mesh_.pulse[v].corner >> 2].vertex)
            __builtin_prefetch(&mesh_.pulse[w]);
}

void Adaption::findMerges(size_t most) {
    findCandidates();
    none_marked_ = marked_.empty();
    may_merge_.take(list_);
    postpone(most, may_merge_);
    merge_.resize(list_.size());
    forSome(list_, [&](Some some, size_t first) {
        findMerges(some, std::span(merge_).subspan(first, some.size()));
    });
    std::erase_if(merge_, [](const Merge& merge) { return merge.v == kNoCorner; });
}

/// Whether the operation that made u is.
bool Adaption::isNeeded(uint32_t u) const {
    if (criterion_.needsLast(mesh_.vertex[u], mesh_.criteria[u])) return true;
    const Operation& o = mesh_.source().at(mesh_.record[u].last);
    return criterion_.needs(mesh_.vertex[u].position() - o.offset(o.isDummy() ? 0 : 1), o.error,
                            o.radius, o.normals.word());
}

bool Adaption::anyMarkedAround(uint32_t v) const {
    return !mesh_.allNeighbours(v, [&](uint32_t w) { return !marked_.contains(w); });
}

void Adaption::findMerges(Some candidates, std::span<Merge> merges) {
    std::array<uint32_t, kTogether> ends;
    std::array<size_t, kTogether> of;
    size_t count = 0;
    for (const uint32_t u : candidates) {
        __builtin_prefetch(&mesh_.pulse[u]);
        __builtin_prefetch(&mesh_.record[u]);
        __builtin_prefetch(&mesh_.vertex[u]);
    }
    for (const uint32_t u : candidates)
        __builtin_prefetch(&mesh_.source().at(mesh_.record[u].last));
    for (size_t i = 0; i < candidates.size(); ++i) {
        const uint32_t u = candidates[i];
        merges[i] = {kNoCorner, u, {kNoCorner, kNoCorner}};
        const bool blocked = mesh_.pulse[u].higher() > 0;
        setBlocked(u, blocked);
        if (!blocked && !marked_.contains(u) && !isNeeded(u)) {
            of[count] = i;
            ends[count++] = u;
        }
    }
    prefetchOtherEnds({ends.data(), count});
    for (size_t j = 0; j < count; ++j) {
        const uint32_t u = ends[j], v = mesh_.otherEnd(u);
        if (mesh_.pulse[v].higher() > 0) {
            setBlocked(u, true);
        } else {
            merges[of[j]].v = v;
        }
    }
    if (none_marked_) return;
    for (Merge& m : merges)
        if (m.v != kNoCorner && (anyMarkedAround(m.u) || anyMarkedAround(m.v))) m.v = kNoCorner;
}

/// What an operation between `id` and those after or before it reads, but for the star.
void Adaption::prefetch(uint32_t v, OperationId id) const {
    __builtin_prefetch(&mesh_.source().at(id));
    __builtin_prefetch(&mesh_.vertex[v], 1);
    __builtin_prefetch(&mesh_.criteria[v], 1);
}

/// `at`: marked neighbours of the one that has split, at its end v. Those that still wait for it
/// mark it.
void Adaption::wakeAround(const Star& star, uint32_t v, uint32_t at) {
    bool force = false;
    for (; at != 0; at &= at - 1) {
        const uint32_t w = star.neighbour[size_t(std::countr_zero(at))];
        const VertexPulse& p = mesh_.pulse[w];
        if (p.lower() == 0) maySplit(w);
        force |= mesh_.pulse[v].next_level < p.next_level;
    }
    if (force) return mark(v);
    if (!criterion_.needsSplit(mesh_.vertex[v], mesh_.criteria[v])) return;
    if (mesh_.record[v].provisional) {
        unknown_.insert(v);
    } else {
        mark(v);
    }
}

/// Sets places that are not used to kNoCorner.
void Adaption::applySplits(std::span<Split> splits) {
    const ProgressiveMesh& source = mesh_.source();
    std::array<uint32_t, kTogether> vertices;
    std::array<Star, kTogether> stars;
    for (const Split& s : splits) __builtin_prefetch(&mesh_.record[s.v], 1);
    for (size_t i = 0; i < splits.size(); ++i) {
        vertices[i] = splits[i].v;
        prefetch(splits[i].v, mesh_.record[splits[i].v].next);
        prefetch(splits[i].u, mesh_.record[splits[i].v].next);
        __builtin_prefetch(&mesh_.pulse[splits[i].u], 1);
        __builtin_prefetch(&mesh_.record[splits[i].u], 1);
        for (const uint32_t f : splits[i].face) __builtin_prefetch(&mesh_.face[f], 1);
    }
    gather({vertices.data(), splits.size()}, stars.data());
    for (const Split& s : splits)
        for (const OperationId child : source.at(mesh_.record[s.v].next).child)
            if (child != kNoOperation && source.isLoaded(child))
                __builtin_prefetch(&source.at(child));
    for (size_t i = 0; i < splits.size(); ++i) {
        Split& s = splits[i];
        const Operation& o = source.at(mesh_.record[s.v].next);
        marked_.erase(s.v);
        if (!mesh_.mayBeNext(stars[i], s.v)) {
            mesh_.record[s.v].provisional = VertexRecord::kRefused;
            s = {s.v, kNoCorner, {kNoCorner, kNoCorner}};
            ++refused_;
            continue;
        }
        uint32_t marked = 0;
        for (uint32_t j = 0; j < stars[i].neighbours(); ++j)
            marked |= uint32_t(marked_.contains(stars[i].neighbour[j])) << j;
        if (o.isDummy()) {
            mesh_.move(s.v, stars[i]);
            s = {s.v, kNoCorner, {kNoCorner, kNoCorner}};
            wakeAround(stars[i], s.v, marked);
        } else {
            const auto [at_v, at_u] = mesh_.split(s.v, stars[i], s.u, s.face);
            if (o.rankLeft() == kNoRank || o.rankRight() == kNoRank) s.face[1] = kNoCorner;
            wakeAround(stars[i], s.v, at_v & marked);
            wakeAround(stars[i], s.u, at_u & marked);
        }
    }
}

/// No other around merges at the same time.
bool Adaption::isAlone(const Merge& m, const Star& star, const Star& other) const {
    if (star.count == 0 || other.count == 0) return false;
    const uint16_t level = mesh_.pulse[m.v].last_level;
    const auto ring = other.ring();
    if (m.u != m.v && std::find(ring.begin(), ring.end(), m.v) == ring.end()) return false;
    for (const Star* s : {&star, &other})
        for (const uint32_t w : s->ring())
            if (w != m.u && w != m.v && mesh_.pulse[w].last_level == level) return false;
    return true;
}

void Adaption::applyMerges(std::span<Merge> merges) {
    std::array<uint32_t, 2 * kTogether> vertices;
    std::array<Star, 2 * kTogether> stars;
    const size_t count = merges.size();
    for (const Merge& m : merges) __builtin_prefetch(&mesh_.record[m.u]);
    for (size_t i = 0; i < count; ++i) {
        vertices[i] = merges[i].v;
        vertices[count + i] = merges[i].u;
        prefetch(merges[i].v, mesh_.record[merges[i].u].last);
        __builtin_prefetch(&mesh_.record[merges[i].v]);
    }
    gather({vertices.data(), count}, stars.data());
    gather({vertices.data() + count, count}, stars.data() + count);
    for (const Merge& m : merges) {
        const OperationId before = mesh_.record[m.u].undo_last;
        if (before != kNoOperation) __builtin_prefetch(&mesh_.source().at(before));
    }
    for (size_t i = 0; i < count; ++i) {
        Merge& m = merges[i];
        if (!isAlone(m, stars[i], stars[count + i])) {
            m = {kNoCorner, kNoCorner, {kNoCorner, kNoCorner}};
            ++refused_;
            continue;
        }
        if (m.u == m.v) {
            mesh_.moveBack(m.v, stars[i]);
            m.u = kNoCorner;
        } else {
            m.face = mesh_.merge(m.v, stars[i], m.u, stars[count + i]);
        }
        const auto release = [&](uint32_t w) {
            const VertexPulse& p = mesh_.pulse[w];
            if (p.last_level != 0 && p.higher() == 0) released_.insert(w);
        };
        for (const size_t end : {i, count + i})
            for (const uint32_t w : stars[end].ring())
                if (w != m.u && w != m.v) release(w);
        release(m.v);
    }
}

void Adaption::apply() {
    const size_t splits = split_.size();
    const auto beyond = [](size_t wanted, const std::vector<uint32_t>& free) {
        return wanted - std::min(wanted, free.size());
    };
    mesh_.resize(mesh_.vertexCount() + beyond(splits, free_vertex_),
                 mesh_.faceCount() + beyond(2 * splits, free_face_));
    for (VertexSet* set : {&marked_, &fresh_, &may_split_, &released_, &may_merge_, &unknown_})
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

void Adaption::listWaiting() {
    waiting_.clear();
    const auto list = [&](uint32_t v) {
        waiting_.push_back(
            {mesh_.record[v].next, criterion_.needsSplit(mesh_.vertex[v], mesh_.criteria[v])});
    };
    marked_.take(list_);
    for (const uint32_t v : list_) list(v);
    unknown_.take(list_);
    for (const uint32_t v : list_)  // since then it may have split or gone
        if (mesh_.record[v].provisional && mesh_.pulse[v].name != kNoCorner) list(v);
}

/// No place is left free.
void Adaption::tidy() {
    findCandidates();
    may_merge_.take(list_);
    for (const uint32_t u : list_) setBlocked(u, false);
    if (!free_vertex_.empty() || !free_face_.empty()) mesh_.fillHoles(free_vertex_, free_face_);
    free_vertex_.clear();
    free_face_.clear();
}

}  // namespace pietra::pmesh
