#include "methods/pmesh/front/leaf_front.h"

#include <algorithm>
#include <bit>
#include <cstring>
#include <utility>

#include "base/check.h"

namespace pietra::pmesh {
namespace {

constexpr uint32_t kBatch = 8;  ///< blocks that a thread goes through together

template <class Word, class Body>
void forBits(Word bits, Body&& body) {
    for (; bits != 0; bits &= bits - 1) body(uint32_t(std::countr_zero(bits)));
}

template <class T>
void setBit(T& words, uint32_t bit) {
    words[bit / 64 % words.size()] |= uint64_t(1) << bit % 64;
}

/// So many lines of a cache. The processor itself does not prefetch beyond 4 KiB.
void prefetchLines(const void* from, size_t bytes) {
    for (size_t i = 0; i < bytes; i += 64)
        __builtin_prefetch(static_cast<const char*>(from) + i);
}

}  // namespace

LeafFront::LeafFront(const LeafForest& forest) : forest_(forest) {
    const size_t blocks = (forest.leaves() + kBlockLeaves - 1) / kBlockLeaves;
    bits_.resize(FrontIndex::kBefore + blocks * kBlockLeaves / 64);
    active_ = bits_.data() + FrontIndex::kBefore;
    slot_.resize(blocks * kBlockLeaves + 2);
    count_.resize(blocks);
    block_.resize(blocks);
    index_ = {active_, slot_.data(), count_.data()};
    pool_.reset(HugeAllocator<FrontPage>().allocate(blocks * kPages));
    place_of_page_.resize(blocks * kPages);
    for (const LeafRoot& root : forest.root) {
        const auto [page, slot] = add(root.first);
        NestedCriterion ever;
        ever.error = NestedCriterion::kEver;
        page.birth.set(slot, ever);
        page.next.set(slot, root.criterion);
        page.split[slot] = root.split;
        page.vertex[slot] = root.vertex;
    }
    base_leaf_ = forest.base_corner;
    base_leaf_.resize((base_leaf_.size() + 15) / 16 * 16);
    base_slot_.resize(base_leaf_.size());
    if (blocks > 0) findSlots(index_, base_leaf_.data(), base_slot_.data(), base_leaf_.size());
    for (Block& b : block_) b.changed = false;
}

/// An empty one.
void LeafFront::addPage(uint32_t block) {
    uint32_t& place = place_of_page_[block * kPages + block_[block].pages++];
    {
        const std::lock_guard lock(pool_mutex_);
        if (free_places_.empty()) {
            place = pool_end_++;
        } else {
            place = free_places_.back();
            free_places_.pop_back();
        }
    }
    std::memset(static_cast<void*>(&pool_[place]), 0, sizeof(FrontPage));
}

/// The last one.
void LeafFront::removePage(uint32_t block) {
    const std::lock_guard lock(pool_mutex_);
    free_places_.push_back(place_of_page_[block * kPages + --block_[block].pages]);
}

/// A slot in its block. All but its first leaf is to be filled in.
LeafFront::Place LeafFront::add(Leaf vertex) {
    const uint32_t block = vertex >> kBlockBits;
    Block& b = block_[block];
    while (b.first_free < b.pages && pageOf(block, b.first_free).alive == ~0u) ++b.first_free;
    if (b.first_free == b.pages) addPage(block);
    FrontPage& page = pageOf(block, b.first_free);
    const auto slot = uint32_t(std::countr_one(page.alive));
    page.alive |= 1u << slot;
    page.changed = 1;
    page.first[slot] = vertex;
    page.leaf[slot].fill(0);
    slot_[vertex] = uint16_t(b.first_free * kPageSlots + slot);
    b.grown |= uint64_t(1) << b.first_free;
    b.changed = true;
    setActive(vertex, true);
    return {page, slot};
}

void LeafFront::refer(FrontPage& page, uint32_t slot) const {
    for (const Leaf leaf : page.leaf[slot]) setBit(page.refers, leaf >> kBlockBits);
}

/// What is needed no more is dropped, what is to be split is marked.
void LeafFront::decide(uint32_t block, const FrontView& view) {
    Block& b = block_[block];
    b.splits = b.merges = 0;
    b.grown = 0;
    for (uint32_t p = 0; p < b.pages; ++p) {
        FrontPage& page = pageOf(block, p);
        if (p + 1 < b.pages)
            prefetchLines(&pageOf(block, p + 1), sizeof(page.birth) + sizeof(page.next));
        const PageScan scan = scanPage(view, page);
        const uint32_t drop = page.alive & ~scan.birth;
        page.opened = scan.next & ~drop;
        b.opened |= uint64_t(page.opened != 0) << p;
        if (drop == 0) continue;
        page.dropped = drop;
        page.alive &= ~drop;
        b.first_free = std::min(b.first_free, p);
        b.merges += uint32_t(std::popcount(drop));
        forBits(drop, [&](uint32_t s) { setActive(page.first[s], false); });
    }
}

/// Of all operations undone next to each other, the one that is above the others tells what v is.
void LeafFront::merge(uint32_t block, Deferred& deferred) {
    Block& b = block_[block];
    if (b.merges == 0) return;
    b.changed = true;
    for (uint32_t p = 0; p < b.pages; ++p) {
        FrontPage& page = pageOf(block, p);
        page.stale += uint32_t(std::popcount(page.dropped));
        forBits(std::exchange(page.dropped, 0), [&](uint32_t s) {
            page.next.error[s] = 0;
            page.leaf[s].fill(0);
            const Leaf parent = page.parent[s];
            if (parent != kNoLeaf && !isActive(parent)) return;
            const Leaf u = page.first[s], v = ownerOf(index_, u);
            const Merge m{v, u, page.birth.get(s), page.merged[s]};
            if (v >> kBlockBits == block)
                applyMerge(m);
            else
                deferred.merge.push_back(m);
        });
    }
}

void LeafFront::applyMerge(const Merge& m) {
    const auto [page, slot] = placeOf(m.vertex);
    page.split[slot] = m.split;
    page.next.set(slot, m.criterion);
    page.vertex[slot] = m.merged;
}

void LeafFront::prefetch(uint32_t block) const {
    forBits(block_[block].opened, [&](uint32_t p) {
        const FrontPage& page = pageOf(block, p);
        forBits(page.opened, [&](uint32_t s) {
            prefetchLines(&forest_.split[page.split[s]], sizeof(LeafSplit));
        });
    });
}

void LeafFront::splitAll(uint32_t block, Deferred& deferred) {
    forBits(std::exchange(block_[block].opened, 0), [&](uint32_t p) {
        FrontPage& page = pageOf(block, p);
        forBits(std::exchange(page.opened, 0), [&](uint32_t s) {
            if (page.split[s] >> kBlockBits == block)
                applySplit({page, s});
            else
                deferred.split.push_back(page.first[s]);
        });
    });
}

void LeafFront::applySplit(Place v) {
    const Leaf name = v.page.split[v.slot];
    const LeafSplit& split = forest_.split[name];
    const Place u = add(name);
    ++block_[name >> kBlockBits].splits;
    u.page.birth.set(u.slot, v.page.next.get(v.slot));
    u.page.merged[u.slot] = v.page.vertex[v.slot];
    u.page.parent[u.slot] = split.parent;
    u.page.leaf[u.slot] = split.corner;
    refer(u.page, u.slot);
    for (const size_t end : {0u, 1u}) {
        const auto [page, slot] = end == 0 ? v : u;
        page.split[slot] = split.child[end];
        page.vertex[slot] = split.vertex[end];
        page.next.set(slot, split.criterion[end]);
    }
    const Leaf first = v.page.first[v.slot];
    Block& b = block_[first >> kBlockBits];
    b.grown |= uint64_t(1) << slot_[first] / kPageSlots;
}

void LeafFront::look(uint32_t block, const FrontView& view) {
    Block& b = block_[block];
    forBits(std::exchange(b.grown, 0), [&](uint32_t p) {
        FrontPage& page = pageOf(block, p);
        page.opened = scanSplits(view, page);
        b.opened |= uint64_t(page.opened != 0) << p;
    });
}

/// Splits within these blocks until only what crosses their borders is left.
void LeafFront::round(std::span<const uint32_t> blocks, const FrontView& view,
                      Deferred& deferred) {
    for (bool busy = true; busy;) {
        busy = false;
        for (const uint32_t b : blocks) prefetch(b);
        for (const uint32_t b : blocks)
            if (block_[b].opened != 0) splitAll(b, deferred);
        for (const uint32_t b : blocks) {
            if (block_[b].grown != 0) look(b, view);
            busy |= block_[b].opened != 0;
        }
    }
}

/// Vertices of the last pages go where there is room.
void LeafFront::pack(uint32_t block) {
    Block& b = block_[block];
    const uint32_t count = count_[block];
    if (b.pages * kPageSlots < count + count / 4 + 2 * kPageSlots) return;
    const uint32_t enough = (count + kPageSlots - 1) / kPageSlots;
    uint32_t to = 0;
    for (; b.pages > enough; removePage(block)) {
        FrontPage& from = pageOf(block, b.pages - 1);
        forBits(from.alive, [&](uint32_t s) {
            while (pageOf(block, to).alive == ~0u) ++to;
            FrontPage& page = pageOf(block, to);
            const auto slot = uint32_t(std::countr_one(page.alive));
            page.alive |= 1u << slot;
            page.changed = 1;
            page.birth.set(slot, from.birth.get(s));
            page.next.set(slot, from.next.get(s));
            page.first[slot] = from.first[s];
            page.split[slot] = from.split[s];
            page.parent[slot] = from.parent[s];
            page.vertex[slot] = from.vertex[s];
            page.merged[slot] = from.merged[s];
            page.leaf[slot] = from.leaf[s];
            refer(page, slot);
            slot_[page.first[slot]] = uint16_t(to * kPageSlots + slot);
        });
    }
    b.first_free = std::min(b.first_free, to);
    b.changed = true;
}

/// What a block begins with hangs below the last vertex before.
void LeafFront::spreadChanges() {
    changed_blocks_.fill(0);
    bool changed = false;
    for (uint32_t b = 0; b < block_.size(); ++b) {
        changed = block_[b].changed || (changed && !isActive(b * kBlockLeaves));
        if (changed) setBit(changed_blocks_, b);
    }
}

void LeafFront::findCorners(uint32_t block) {
    Block& b = block_[block];
    for (uint32_t p = 0; p < b.pages; ++p) {
        FrontPage& page = pageOf(block, p);
        uint64_t concerned = page.changed;
        for (size_t w = 0; w < changed_blocks_.size(); ++w)
            concerned |= page.refers[w] & changed_blocks_[w];
        if (concerned == 0) continue;
        if (page.stale > kPageSlots) {
            page.refers.fill(0);
            forBits(page.alive, [&](uint32_t s) { refer(page, s); });
            page.stale = 0;
        }
        page.changed = 0;
        if (p + 1 < b.pages)
            prefetchLines(&pageOf(block, p + 1).leaf, sizeof(page.leaf) + sizeof(page.corner));
        findSlots(index_, page.leaf[0].data(), page.corner[0].data(), 6 * kPageSlots);
    }
    b.changed = false;
}

FrontCounts LeafFront::adapt(const FrontView& view) {
    FrontCounts counts;
    const size_t batches = (block_.size() + kBatch - 1) / kBatch;
    const auto forBlocks = [&](size_t batch, auto&& body) {
        const size_t end = std::min(block_.size(), (batch + 1) * kBatch);
        for (size_t b = batch * kBatch; b < end; ++b) body(uint32_t(b));
    };
    parallelFor(batches, [&](size_t batch) {
        forBlocks(batch, [&](uint32_t b) { decide(b, view); });
    });
    PerThread<Deferred> per_thread;
    parallelFor(batches, [&](size_t batch) {
        Deferred& deferred = per_thread.local();
        std::array<uint32_t, kBatch> blocks;
        uint32_t n = 0;
        forBlocks(batch, [&](uint32_t b) { blocks[n++] = b; });
        for (uint32_t i = 0; i < n; ++i) merge(blocks[i], deferred);
        round(std::span(blocks).first(n), view, deferred);
    });
    Deferred all;
    const auto gather = [&] {
        all.split.clear();
        for (Deferred& d : per_thread) {
            all.merge.insert(all.merge.end(), d.merge.begin(), d.merge.end());
            all.split.insert(all.split.end(), d.split.begin(), d.split.end());
            d = {};
        }
        std::sort(all.split.begin(), all.split.end());
        all.split.erase(std::unique(all.split.begin(), all.split.end()), all.split.end());
    };
    gather();
    for (const Merge& m : all.merge) applyMerge(m);
    std::vector<uint32_t> blocks;
    while (!all.split.empty()) {
        ++counts.rounds;
        blocks.clear();
        for (const Leaf v : all.split) {
            const Place place = placeOf(v);
            blocks.push_back(v >> kBlockBits);
            blocks.push_back(place.page.split[place.slot] >> kBlockBits);
            applySplit(place);
        }
        std::sort(blocks.begin(), blocks.end());
        blocks.erase(std::unique(blocks.begin(), blocks.end()), blocks.end());
        parallelFor((blocks.size() + kBatch - 1) / kBatch, [&](size_t batch) {
            const size_t begin = batch * kBatch;
            const auto some = std::span(blocks).subspan(
                begin, std::min<size_t>(kBatch, blocks.size() - begin));
            for (const uint32_t b : some) look(b, view);
            round(some, view, per_thread.local());
        });
        gather();
    }
    for (const Block& b : block_) counts.splits += b.splits, counts.merges += b.merges;
    if (counts.operations() == 0) return counts;
    parallelFor(batches, [&](size_t batch) { forBlocks(batch, [&](uint32_t b) { pack(b); }); });
    spreadChanges();
    parallelFor(batches,
                [&](size_t batch) { forBlocks(batch, [&](uint32_t b) { findCorners(b); }); });
    findSlots(index_, base_leaf_.data(), base_slot_.data(), base_leaf_.size());
    return counts;
}

size_t LeafFront::vertexCount() const {
    size_t count = 0;
    for (const uint32_t c : count_) count += c;
    return count;
}

size_t LeafFront::triangleCount() const {
    size_t count = forest_.base_corner.size() / 3;
    forEachPage([&](const FrontPage& page, uint32_t) {
        forBits(page.alive, [&](uint32_t s) {
            for (size_t t = 0; t < 6; t += 3)
                count += page.leaf[s][t] != page.leaf[s][t + 1];
        });
    });
    return count;
}

}  // namespace pietra::pmesh
