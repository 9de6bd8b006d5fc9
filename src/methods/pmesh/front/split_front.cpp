#include "methods/pmesh/front/split_front.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstring>
#include <new>
#include <utility>

#include "base/check.h"
#include "base/give_back.h"

namespace pietra::pmesh {
namespace {

constexpr size_t kBatch = 4;  ///< blocks of a task

template <class Body>
void forBits(uint32_t bits, Body&& body) {
    for (; bits != 0; bits &= bits - 1) body(uint32_t(std::countr_zero(bits)));
}

void prefetchLines(const void* from, size_t bytes) {
    for (size_t i = 0; i < bytes; i += 64) __builtin_prefetch(static_cast<const char*>(from) + i);
}

int32_t trianglesOf(const std::array<Leaf, 6>& leaf) {
    return int32_t(leaf[0] != leaf[1]) + int32_t(leaf[3] != leaf[4]);
}

}  // namespace

SplitFront::SplitFront(const ResidentSplits& nodes)
    : nodes_(nodes),
      words_a_vertex_(nodes.forest().layout.words()),
      bits_((size_t(nodes.leaves()) + 63) / 64),
      index_(bits_.size()),
      pool_(size_t(nodes.leaves()) / (kPageVertices * kSlabPages) * 2 + 64),
      words_(words_a_vertex_ ? pool_.size() : 0) {
    const SplitBase& base = nodes.forest().base;
    triangles_ = base.triangle.size();
    if (base.root.empty()) return;
    block_.resize(1);
    block_[0].word_end = uint32_t(bits_.size());
    Leaf first = 0;
    uint32_t last_word = 0;
    for (size_t r = 0; r < base.root.size(); ++r) {
        const SplitBase::Root& root = base.root[r];
        const uint32_t word = first / 64;
        if (block_.back().alive >= kMostInBlock && word != last_word) {
            const auto before = uint32_t(block_.size()) - 1;
            block_.emplace_back();
            block_.back().word_begin = word;
            block_.back().word_end = std::exchange(block_[before].word_end, word);
            block_.back().previous = before;
            block_[before].next = before + 1;
        }
        last_word = word;
        Block& block = block_.back();
        const uint32_t slot = add(block, first);
        SplitPage& page = pageAt(block, slot);
        const uint32_t i = slot % kPageVertices;
        NestedCriterion ever;
        ever.error = NestedCriterion::kEver;
        page.birth.set(i, ever);
        page.split[i] = root.split;
        page.made[i] = kNoSplit;
        page.last[i] = page.parent[i] = kNoLeaf;
        page.vertex[i] = root.vertex;
        if (root.split != kNoSplit) page.next.set(i, nodes.rootCriterion(root.split));
        if (words_a_vertex_)
            std::copy_n(&base.word[r * words_a_vertex_], words_a_vertex_, wordsOf(block, slot));
        first += root.leaves;
    }
    for (Block& b : block_) b.changed = true;
    commit();
}

// ---- memory

uint32_t SplitFront::takePage() {
    const std::lock_guard lock(pool_mutex_);
    std::vector<uint32_t>& pages = free_pages_.empty() ? clean_pages_ : free_pages_;
    if (pages.empty()) {
        const size_t slab = size_t(std::find(pool_.begin(), pool_.end(), nullptr) - pool_.begin());
        CHECK_LT(slab, pool_.size());
        void* memory = std::aligned_alloc(sizeof(SplitPage), kSlabPages * sizeof(SplitPage));
        if (memory == nullptr) throw std::bad_alloc();
        pool_[slab].reset(static_cast<SplitPage*>(memory));
        if (words_a_vertex_)
            words_[slab].resize(size_t(kSlabPages) * kPageVertices * 2 * words_a_vertex_);
        for (uint32_t i = kSlabPages; i-- > 0;) pages.push_back(uint32_t(slab) * kSlabPages + i);
    }
    const uint32_t page = pages.back();
    pages.pop_back();
    return page;
}

void SplitFront::addPage(Block& b) {
    b.page.push_back(takePage());
    std::memset(static_cast<void*>(&pageAt(b, uint32_t(b.page.size() - 1) * kPageVertices)), 0,
                sizeof(SplitPage));
}

void SplitFront::dropPages(Block& b) {
    const std::lock_guard lock(pool_mutex_);
    free_pages_.insert(free_pages_.end(), b.page.begin(), b.page.end());
    b.page.clear();
}

size_t SplitFront::bytes() const {
    size_t bytes = (bits_.size() * sizeof(uint64_t) + index_.size() * sizeof(uint32_t)) +
                   block_.size() * sizeof(Block);
    size_t pages = free_pages_.size();
    for (const Block& b : block_) {
        pages += b.page.size();
        bytes += b.order.capacity() * sizeof(uint16_t) + b.leaf.capacity() * sizeof(Leaf) +
                 b.page.capacity() * sizeof(uint32_t) +
                 (b.added.capacity() + b.queue.capacity()) * sizeof(uint16_t);
    }
    const size_t words = kPageVertices * 2 * words_a_vertex_ * sizeof(uint32_t);
    return bytes + pages * (sizeof(SplitPage) + words);
}

/// A slot in the block. All but its first leaf is to be filled in.
uint32_t SplitFront::add(Block& b, Leaf first) {
    const auto fullAt = [&](uint32_t p) { return pageAt(b, p * kPageVertices).alive == ~0u; };
    while (b.first_free < b.page.size() && fullAt(b.first_free)) ++b.first_free;
    if (b.first_free == b.page.size()) addPage(b);
    SplitPage& page = pageAt(b, b.first_free * kPageVertices);
    const auto i = uint32_t(std::countr_one(page.alive));
    page.alive |= 1u << i;
    page.closed &= ~(1u << i);
    page.first[i] = first;
    page.leaf[i].fill(0);
    page.next.error[i] = 0;
    ++b.alive;
    const uint32_t slot = b.first_free * kPageVertices + i;
    b.added.push_back(uint16_t(slot));
    b.changed = true;
    return slot;
}

void SplitFront::copyVertex(const Block& from, uint32_t slot, Block& to, uint32_t into) {
    const SplitPage& p = pageAt(from, slot);
    SplitPage& q = pageAt(to, into);
    const uint32_t i = slot % kPageVertices, j = into % kPageVertices;
    q.birth.set(j, p.birth.get(i));
    q.next.set(j, p.next.get(i));
    q.first[j] = p.first[i];
    q.split[j] = p.split[i];
    q.made[j] = p.made[i];
    q.last[j] = p.last[i];
    q.parent[j] = p.parent[i];
    q.vertex[j] = p.vertex[i];
    q.merged[j] = p.merged[i];
    q.leaf[j] = p.leaf[i];
    q.alive |= 1u << j;
    q.opened |= (p.opened >> i & 1) << j;
    q.closed |= (p.closed >> i & 1) << j;
    if (words_a_vertex_) std::copy_n(wordsOf(from, slot), 2 * words_a_vertex_, wordsOf(to, into));
}

// ---- what is dropped

uint32_t SplitFront::mayOpen(const SplitPage& page, uint32_t needed) const {
    uint32_t open = 0;
    forBits(needed & page.alive, [&](uint32_t i) {
        if (mayOpen(page.split[i], page.next.get(i))) open |= 1u << i;
    });
    return open;
}

void SplitFront::decide(Block& b, const SplitView& view) {
    b.splits = b.merges = 0;
    b.triangles = 0;
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        SplitPage& page = pageAt(b, p * kPageVertices);
        if (p + 1 < b.page.size())
            prefetchLines(&pageAt(b, (p + 1) * kPageVertices), 2 * sizeof(CriterionPage));
        const PageNeeds needs = scanPage(view, page);
        page.dropped = page.alive & ~needs.birth;
        page.alive &= needs.birth;
        page.opened = mayOpen(page, needs.next);
        if (page.dropped == 0) continue;
        b.first_free = std::min(b.first_free, p);
        b.merges += uint32_t(std::popcount(page.dropped));
    }
    b.alive -= b.merges;
}

size_t SplitFront::toDo(const SplitView& view) const {
    std::atomic<size_t> count = 0;
    parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
        size_t here = 0;
        for (size_t b = begin; b < end; ++b)
            for (uint32_t p = 0; p < block_[b].page.size(); ++p) {
                const SplitPage& page = pageAt(block_[b], p * kPageVertices);
                const PageNeeds needs = scanPage(view, page);
                here += size_t(std::popcount(page.alive & ~needs.birth) +
                               std::popcount(mayOpen(page, needs.next)));
            }
        count += here;
    });
    return count;
}

/// It was active when the frame began: is it still?
bool SplitFront::isAlive(Leaf name) const {
    const Place p = ownerOf(name);
    const Slot slot = slotAt(p);
    return firstLeaf(p) == name && (slot.page.alive >> slot.i & 1) != 0;
}

/// Of all splits undone next to each other, the one that is above the others tells what v is.
void SplitFront::merge(uint32_t block, Deferred& deferred) {
    Block& b = block_[block];
    if (b.merges == 0) return;
    b.changed = true;
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        SplitPage& page = pageAt(b, p * kPageVertices);
        forBits(std::exchange(page.dropped, 0), [&](uint32_t i) {
            page.next.error[i] = 0;
            b.triangles -= trianglesOf(page.leaf[i]);
            if (page.parent[i] != kNoLeaf && !isAlive(page.parent[i])) return;
            Place v = ownerOf(page.first[i]);
            for (;;) {
                if (v.rank == 0) {
                    v.block = block_[v.block].previous;
                    v.rank = uint32_t(block_[v.block].order.size());
                }
                --v.rank;
                const Slot slot = slotAt(v);
                if (slot.page.alive >> slot.i & 1) break;
            }
            const Merge m{
                v,
                page.made[i],
                page.parent[i],
                page.birth.get(i),
                page.merged[i],
                words_a_vertex_ ? wordsOf(b, p * kPageVertices + i) + words_a_vertex_ : nullptr};
            if (v.block == block)
                applyMerge(m);
            else
                deferred.merge.push_back(m);
        });
    }
}

void SplitFront::applyMerge(const Merge& m) {
    Block& b = block_[m.vertex.block];
    const uint32_t slot = b.order[m.vertex.rank], i = slot % kPageVertices;
    SplitPage& page = pageAt(b, slot);
    page.split[i] = m.split;
    page.next.set(i, m.criterion);
    page.vertex[i] = m.merged;
    page.last[i] = m.last;
    if (words_a_vertex_) std::copy_n(m.words, words_a_vertex_, wordsOf(b, slot));
    b.changed = true;
}

// ---- how much is to be split

/// How many splits the view asks for; no more than that they are more than `enough`.
size_t SplitFront::countSplits(const SplitView& view, size_t enough) {
    std::atomic<size_t> count = 0;
    parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
        std::vector<SplitId> stack;
        for (size_t b = begin; b < end; ++b)
            for (uint32_t p = 0; p < block_[b].page.size(); ++p) {
                const SplitPage& page = pageAt(block_[b], p * kPageVertices);
                size_t here = 0;
                forBits(page.opened, [&](uint32_t i) {
                    if (view.needs(page.next.get(i))) stack.push_back(page.split[i]);
                    for (; !stack.empty() && here <= enough; ++here) {
                        const ResidentSplit& s = nodes_.at(stack.back());
                        stack.pop_back();
                        for (const size_t end_of : {0u, 1u})
                            if (s.child[end_of] != kNoSplit && view.needs(s.criterion[end_of]) &&
                                mayOpen(s.child[end_of], s.criterion[end_of]))
                                stack.push_back(s.child[end_of]);
                    }
                });
                if ((count += here) > enough) return;
            }
    });
    return count;
}

/// The same, or one of a coarser tolerance: what that needs is a closed set, too.
SplitView SplitFront::withinLimits(const SplitView& view, const SplitLimits& limits,
                                   SplitCounts& counts) {
    const size_t room = limits.vertices - std::min(limits.vertices, vertices_);
    const size_t most = std::min(room, limits.splits);
    const size_t roots = nodes_.forest().base.root.size();
    if (most >= nodes_.loaded() * kSplitSlots - (vertices_ - roots)) return view;
    if (countSplits(view, most) <= most) return view;
    (room <= limits.splits ? counts.short_of_vertices : counts.short_of_splits) = true;
    const auto coarser = [&](double octaves) {
        SplitView v = view;
        v.reach = float(double(view.reach) * std::exp2(-octaves));
        return v;
    };
    // In octaves, coarse ones first: those of a view that fits are found in some ten steps.
    double fine = 0, coarse = 128;
    size_t at_coarse = 0;
    while (coarse - fine > (at_coarse > 0 ? 0.05 : 1e-4)) {
        const double middle = (fine + coarse) / 2;
        const size_t count = countSplits(coarser(middle), most);
        if (count <= most)
            coarse = middle, at_coarse = count;
        else
            fine = middle;
    }
    // Some is always done, if memory allows.
    if (at_coarse == 0 && countSplits(coarser(fine), room) <= room) return coarser(fine);
    return coarser(coarse);
}

/// What was opened for a finer view.
void SplitFront::reopen(Block& b, const SplitView& view) {
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        SplitPage& page = pageAt(b, p * kPageVertices);
        if (page.opened != 0) page.opened &= scanNext(view, page);
    }
}

// ---- what is split

void SplitFront::prefetch(const Block& b, uint32_t slot) const {
    prefetchLines(&nodes_.at(pageAt(b, slot).split[slot % kPageVertices]), sizeof(ResidentSplit));
}

void SplitFront::fillQueue(Block& b) {
    for (uint32_t p = 0; p < b.page.size(); ++p)
        forBits(std::exchange(pageAt(b, p * kPageVertices).opened, 0),
                [&](uint32_t i) { b.queue.push_back(uint16_t(p * kPageVertices + i)); });
}

void SplitFront::splitAll(uint32_t block, const SplitView& view, Deferred& deferred) {
    Block& b = block_[block];
    constexpr size_t kAhead = 8;
    for (size_t at = 0; at < std::min(kAhead, b.queue.size()); ++at) prefetch(b, b.queue[at]);
    size_t at = 0;
    for (; at < b.queue.size() && b.alive < kMostInRound; ++at) {
        if (at + kAhead < b.queue.size()) prefetch(b, b.queue[at + kAhead]);
        const uint32_t slot = b.queue[at];
        const SplitId split = pageAt(b, slot).split[slot % kPageVertices];
        if (blockOf(nodes_.at(split).name) == block)
            applySplit(b, slot, b, view);
        else
            deferred.split.push_back({block, slot});
    }
    b.queue.erase(b.queue.begin(), b.queue.begin() + ptrdiff_t(at));
}

void SplitFront::applySplit(Block& b, uint32_t slot, Block& of_u, const SplitView& view) {
    const uint32_t i = slot % kPageVertices;
    const SplitId id = pageAt(b, slot).split[i];
    const ResidentSplit& split = nodes_.at(id);
    const uint32_t u_slot = add(of_u, split.name), j = u_slot % kPageVertices;
    SplitPage& v = pageAt(b, slot);
    SplitPage& u = pageAt(of_u, u_slot);
    const NestedCriterion own = v.next.get(i);
    u.birth.set(j, own);
    u.made[j] = id;
    u.merged[j] = v.vertex[i];
    u.parent[j] = v.last[i];
    u.leaf[j] = split.corner;
    u.closed |= uint32_t(split.closed) << j;
    v.last[i] = u.last[j] = split.name;
    v.vertex[i] = split.vertex[0];
    u.vertex[j] = split.vertex[1];
    v.split[i] = split.child[0];
    u.split[j] = split.child[1];
    // A good file's are within.
    v.next.set(i, own.within(split.criterion[0]));
    u.next.set(j, own.within(split.criterion[1]));
    if (words_a_vertex_) {
        uint32_t* const of_v = wordsOf(b, slot);
        uint32_t* const to_u = wordsOf(of_u, u_slot);
        const uint32_t* const words = nodes_.wordsOf(id);
        std::copy_n(of_v, words_a_vertex_, to_u + words_a_vertex_);
        std::copy_n(words, words_a_vertex_, of_v);
        std::copy_n(words + words_a_vertex_, words_a_vertex_, to_u);
    }
    of_u.triangles += trianglesOf(split.corner);
    ++of_u.splits;
    b.changed = true;
    openIfNeeded(b, slot, view);
    openIfNeeded(of_u, u_slot, view);
}

void SplitFront::openIfNeeded(Block& b, uint32_t slot, const SplitView& view) {
    const SplitPage& page = pageAt(b, slot);
    const uint32_t i = slot % kPageVertices;
    if (page.split[i] == kNoSplit) return;
    const NestedCriterion next = page.next.get(i);
    if (!view.needs(next) || !mayOpen(page.split[i], next)) return;
    b.queue.push_back(uint16_t(slot));
}

double SplitFront::largestError(const View& view) const {
    const SplitForest& forest = nodes_.forest();
    const SplitView one = splitView(view, forest.lattice, forest.grid, 1);
    PerThread<double> largest(0.0);
    parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
        double& most = largest.local();
        for (size_t b = begin; b < end; ++b)
            for (uint32_t p = 0; p < block_[b].page.size(); ++p) {
                const SplitPage& page = pageAt(block_[b], p * kPageVertices);
                forBits(page.alive, [&](uint32_t i) {
                    if (page.split[i] == kNoSplit) return;
                    most = std::max(most, one.pixelsOf(page.next.get(i)));
                });
            }
    });
    double most = 0;
    for (const double m : largest) most = std::max(most, m);
    return most;
}

SplitCounts SplitFront::adapt(const SplitView& keep, const SplitLimits& limits) {
    SplitCounts counts;
    blocks_ = nodes_.anyBlocks();
    const auto forBlocks = [&](auto&& body) {
        parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
            for (size_t b = begin; b < end; ++b) body(uint32_t(b));
        });
    };
    PerThread<Deferred> per_thread;
    forBlocks([&](uint32_t b) { decide(block_[b], keep); });
    forBlocks([&](uint32_t b) { merge(b, per_thread.local()); });
    for (Deferred& d : per_thread) {
        for (const Merge& m : d.merge) applyMerge(m);
        d.merge.clear();
    }
    for (const Block& b : block_) {
        counts.merges += b.merges;
        triangles_ += size_t(int64_t(b.triangles));
        vertices_ -= b.merges;
    }
    const SplitView view = withinLimits(keep, limits, counts);
    if (view.reach != keep.reach) forBlocks([&](uint32_t b) { reopen(block_[b], view); });
    forBlocks([&](uint32_t b) { block_[b].triangles = 0, fillQueue(block_[b]); });
    std::vector<std::array<uint32_t, 2>> across;
    for (bool busy = true; busy; ++counts.rounds) {
        forBlocks([&](uint32_t b) {
            if (!block_[b].queue.empty()) splitAll(b, view, per_thread.local());
        });
        across.clear();
        for (Deferred& d : per_thread) {
            across.insert(across.end(), d.split.begin(), d.split.end());
            d.split.clear();
        }
        std::sort(across.begin(), across.end());
        for (const auto& [block, slot] : across) {
            Block& b = block_[block];
            const SplitId split = pageAt(b, slot).split[slot % kPageVertices];
            applySplit(b, slot, block_[blockOf(nodes_.at(split).name)], view);
        }
        busy = false;
        bool too_large = false;
        for (const Block& b : block_) {
            busy |= !b.queue.empty();
            too_large |= b.alive >= kMostInRound;
        }
        if (!busy || !too_large) continue;
        for (Block& b : block_)
            for (const uint16_t slot : std::exchange(b.queue, {}))
                pageAt(b, slot).opened |= 1u << slot % kPageVertices;
        commit();
        forBlocks([&](uint32_t b) { fillQueue(block_[b]); });
    }
    commit();
    for (Block& b : block_) {
        counts.splits += std::exchange(b.splits, 0);
        triangles_ += size_t(int64_t(std::exchange(b.triangles, 0)));
    }
    return counts;
}

void SplitFront::arrived(std::span<const ResidentSplits::Arrived> arrived) {
    for (const ResidentSplits::Arrived& a : arrived) {
        const Place p = ownerOf(a.first);
        Block& b = block_[p.block];
        const uint32_t slot = b.order[p.rank], i = slot % kPageVertices;
        SplitPage& page = pageAt(b, slot);
        if (page.first[i] == a.first && page.split[i] == a.split)
            page.next.set(i, page.next.get(i).within(a.criterion));
    }
}

// ---- the index

/// Puts the order of the block right.
void SplitFront::sortBlock(Block& b) {
    const auto firstOf = [&](uint16_t slot) { return pageAt(b, slot).first[slot % kPageVertices]; };
    for (const Leaf leaf : b.leaf) bits_[leaf / 64] = 0;
    std::sort(b.added.begin(), b.added.end(),
              [&](uint16_t a, uint16_t c) { return firstOf(a) < firstOf(c); });
    std::vector<uint16_t> order;
    std::vector<Leaf> leaf;
    order.reserve(b.alive);
    leaf.reserve(b.alive);
    const auto put = [&](uint16_t slot, Leaf first) {
        order.push_back(slot);
        leaf.push_back(first);
        bits_[first / 64] |= uint64_t(1) << first % 64;
    };
    size_t next = 0;
    for (size_t r = 0; r < b.order.size(); ++r) {
        const uint16_t slot = b.order[r];
        const SplitPage& page = pageAt(b, slot);
        const uint32_t i = slot % kPageVertices;
        if ((page.alive >> i & 1) == 0 || page.first[i] != b.leaf[r]) continue;
        for (; next < b.added.size() && firstOf(b.added[next]) < b.leaf[r]; ++next)
            put(b.added[next], firstOf(b.added[next]));
        put(slot, b.leaf[r]);
    }
    for (; next < b.added.size(); ++next) put(b.added[next], firstOf(b.added[next]));
    b.added.clear();
    b.order = std::move(order);
    b.leaf = std::move(leaf);
    if (b.page.size() * kPageVertices > b.order.size() * 5 / 4 + 2 * kPageVertices) {
        Block packed;
        rewrite(b, 0, b.order.size(), packed);
        dropPages(b);
        b.page = std::move(packed.page);
        b.order = std::move(packed.order);
        b.leaf = std::move(packed.leaf);
        b.first_free = packed.first_free;
    }
}

/// Of b's vertices those of some ranks, to the end of another block.
void SplitFront::rewrite(Block& b, size_t begin, size_t end, Block& to) {
    for (size_t r = begin; r < end; ++r) {
        const uint32_t into = add(to, b.leaf[r]);
        copyVertex(b, b.order[r], to, into);
        to.order.push_back(uint16_t(into));
        to.leaf.push_back(b.leaf[r]);
    }
    to.added.clear();
}

uint32_t SplitFront::newBlock() {
    if (free_blocks_.empty()) {
        block_.emplace_back();
        return uint32_t(block_.size()) - 1;
    }
    const uint32_t block = free_blocks_.back();
    free_blocks_.pop_back();
    return block;
}

/// Into parts of about as many vertices, each of whole words.
void SplitFront::cutBlock(uint32_t block) {
    const Block old = std::move(block_[block]);
    block_[block] = {};
    const size_t parts = old.order.size() / (kMostInBlock * 3 / 4) + 1;
    uint32_t current = block;
    size_t begin = 0;
    for (size_t part = 0; part < parts; ++part) {
        size_t end = part + 1 == parts ? old.order.size() : old.order.size() * (part + 1) / parts;
        while (end < old.order.size() && end > begin &&
               old.leaf[end] / 64 == old.leaf[end - 1] / 64)
            ++end;
        if (end <= begin) continue;
        if (begin > 0) {
            const uint32_t after = newBlock();
            block_[current].next = after;
            block_[after] = {};
            block_[after].previous = current;
            current = after;
        }
        Block& b = block_[current];
        b.word_begin = begin > 0 ? old.leaf[begin] / 64 : old.word_begin;
        b.word_end = end < old.order.size() ? old.leaf[end] / 64 : old.word_end;
        if (begin == 0) b.previous = old.previous;
        rewrite(const_cast<Block&>(old), begin, end, b);
        b.splits = begin == 0 ? old.splits : 0;
        b.triangles = begin == 0 ? old.triangles : 0;
        b.changed = true;
        begin = end;
    }
    block_[current].next = old.next;
    if (old.next != kNone) block_[old.next].previous = current;
    dropPages(const_cast<Block&>(old));
}

void SplitFront::joinNext(uint32_t block) {
    Block& b = block_[block];
    const uint32_t gone = b.next;
    Block& other = block_[gone];
    rewrite(other, 0, other.order.size(), b);
    b.word_end = other.word_end;
    b.next = other.next;
    b.splits += other.splits;
    b.triangles += other.triangles;
    b.changed = true;
    if (b.next != kNone) block_[b.next].previous = block;
    dropPages(other);
    other = {};
    other.version = version_;
    free_blocks_.push_back(gone);
}

void SplitFront::writeIndex(uint32_t block) {
    const Block& b = block_[block];
    uint32_t rank = 0;
    for (uint32_t w = b.word_begin; w < b.word_end; ++w) {
        index_[w] = block << kRankBits | rank;
        rank += uint32_t(std::popcount(bits_[w]));
    }
}

/// Ends a frame, or a round that made too much: blocks of a good size, and the index of leaves.
void SplitFront::commit() {
    if (block_.empty()) return;
    ++version_;
    parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b)
            if (block_[b].changed) sortBlock(block_[b]);
    });
    const auto sizeOf = [&](uint32_t b) { return block_[b].order.size(); };
    for (uint32_t b = 0; b != kNone; b = block_[b].next)
        while (block_[b].next != kNone &&
               (sizeOf(block_[b].next) == 0 || sizeOf(b) + sizeOf(block_[b].next) < kFewInBlock))
            joinNext(b);
    for (uint32_t b = 0, next = 0; b != kNone; b = next) {
        next = block_[b].next;
        if (sizeOf(b) > kMostInBlock) cutBlock(b);
    }
    parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) {
            if (!std::exchange(block_[b].changed, false)) continue;
            block_[b].version = version_;
            writeIndex(uint32_t(b));
        }
    });
    vertices_ = 0;
    size_t pages = 0;
    for (const Block& b : block_) vertices_ += b.order.size(), pages += b.page.size();
    if (free_pages_.size() > pages / 4 + 2 * kSlabPages) giveBack();
}

void SplitFront::giveBack() {
    for (const uint32_t page : free_pages_) {
        SplitPage* const p = &pool_[page / kSlabPages][page % kSlabPages];
        pietra::giveBack(p, p + 1);
    }
    clean_pages_.insert(clean_pages_.end(), free_pages_.begin(), free_pages_.end());
    free_pages_.clear();
}

}  // namespace pietra::pmesh
