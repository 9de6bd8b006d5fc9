#include "methods/pmesh/front/split_blocks.h"

#include <algorithm>
#include <new>
#include <utility>

#include "base/check.h"
#include "base/give_back.h"
#include "base/parallel.h"
#include "methods/pmesh/front/split_index.h"

namespace pietra::pmesh {

SplitBlocks::SplitBlocks(Leaf leaves, size_t words_a_vertex)
    : words_a_vertex_(words_a_vertex),
      bits_((size_t(leaves) + 63) / 64),
      index_(bits_.size()),
      block_(leaves > 0 ? 1 : 0),
      pool_(size_t(leaves) / (kPageVertices * kSlabPages) * 3 + 64),
      words_(words_a_vertex_ ? pool_.size() : 0) {
    if (!block_.empty()) block_[0].word_end = uint32_t(bits_.size());
}

// ---- memory

uint32_t SplitBlocks::takePage() {
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

/// The last one.
void SplitBlocks::dropPage(Block& b) {
    const std::lock_guard lock(pool_mutex_);
    free_pages_.push_back(b.page.back());
    b.page.pop_back();
}

size_t SplitBlocks::bytes() const {
    size_t bytes = bits_.size() * sizeof(uint64_t) + index_.size() * sizeof(uint32_t) +
                   block_.size() * sizeof(Block);
    size_t pages = free_pages_.size();
    for (const Block& b : block_) {
        pages += b.page.size();
        bytes +=
            b.page.capacity() * sizeof(uint32_t) + (b.order.capacity() + b.dropping.capacity() +
                                                    b.opening.capacity() + b.grown.capacity()) *
                                                       sizeof(uint16_t);
    }
    const size_t words = kPageVertices * 2 * words_a_vertex_ * sizeof(uint32_t);
    return bytes + pages * (sizeof(SplitPage) + words);
}

/// So many, those that have been free for longest.
void SplitBlocks::giveBack(size_t count) {
    const auto end = free_pages_.begin() + ptrdiff_t(count);
    for (auto page = free_pages_.begin(); page != end; ++page) {
        SplitPage* const p = &pool_[*page / kSlabPages][*page % kSlabPages];
        pietra::giveBack(p, p + 1);
    }
    clean_pages_.insert(clean_pages_.end(), free_pages_.begin(), end);
    free_pages_.erase(free_pages_.begin(), end);
    least_free_ = free_pages_.size();
}

uint32_t SplitBlocks::add(Block& b, Leaf first) {
    while (b.first_free < b.page.size() && page(b, b.first_free).alive == ~0u) ++b.first_free;
    if (b.first_free == b.page.size()) {
        b.page.push_back(takePage());
        SplitPage& p = page(b, b.first_free);
        p.alive = p.dropped = p.opened = p.grown = p.closed = 0;
    }
    SplitPage& p = page(b, b.first_free);
    const auto i = uint32_t(std::countr_one(p.alive));
    p.alive |= 1u << i;
    p.closed &= ~(1u << i);
    p.first[i] = first;
    ++b.alive;
    b.changed = true;
    return b.first_free * kPageVertices + i;
}

void SplitBlocks::copyVertex(const Block& from, uint32_t slot, Block& to, uint32_t into) {
    const auto [p, i] = at(from, slot);
    const auto [q, j] = at(to, into);
    q.birth.set(j, p.birth.get(i));
    q.next.set(j, p.next.get(i));
    q.split[j] = p.split[i];
    q.made[j] = p.made[i];
    q.last[j] = p.last[i];
    q.parent[j] = p.parent[i];
    q.vertex[j] = p.vertex[i];
    q.merged[j] = p.merged[i];
    q.leaf[j] = p.leaf[i];
    for (const auto bits : {&SplitPage::opened, &SplitPage::grown, &SplitPage::closed})
        q.*bits = (q.*bits & ~(1u << j)) | (p.*bits >> i & 1) << j;
    if (words_a_vertex_) std::copy_n(wordsOf(from, slot), 2 * words_a_vertex_, wordsOf(to, into));
}

/// Vertices of the last pages go where there is room.
void SplitBlocks::pack(Block& b) {
    if (b.page.size() * kPageVertices <= b.alive + b.alive / 4 + 2 * kPageVertices) return;
    const size_t enough = (b.alive + kPageVertices - 1) / kPageVertices;
    for (; b.page.size() > enough; dropPage(b)) {
        const auto last = uint32_t(b.page.size() - 1);
        SplitPage& from = page(b, last);
        forBits(std::exchange(from.alive, ~0u), [&](uint32_t i) {
            copyVertex(b, last * kPageVertices + i, b, add(b, from.first[i]));
            --b.alive;
        });
    }
    b.first_free = std::min(b.first_free, uint32_t(b.page.size()));
}

// ---- the index

void SplitBlocks::ownersOf(std::span<const Leaf> leaf, std::span<uint32_t> key) const {
    countUpTo(bits_.data(), index_.data(), leaf, key.data());
    for (size_t i = 0; i < leaf.size(); ++i)
        key[i] = (key[i] & kRankMask) > 0 ? key[i] - 1 : keyOf(ownerOf(leaf[i]));
}

void SplitBlocks::setBits(Block& b) {
    std::fill(bits_.begin() + b.word_begin, bits_.begin() + b.word_end, 0);
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        const SplitPage& from = page(b, p);
        forBits(from.alive, [&](uint32_t i) {
            bits_[from.first[i] / 64] |= uint64_t(1) << from.first[i] % 64;
        });
    }
}

/// Needs bits.
void SplitBlocks::number(uint32_t block) {
    Block& b = block_[block];
    numberWords(&bits_[b.word_begin], b.word_end - b.word_begin, block << kRankBits,
                &index_[b.word_begin]);
    if (b.order.capacity() > 2 * size_t(b.alive)) std::vector<uint16_t>().swap(b.order);
    b.order.resize(b.alive);
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        const SplitPage& from = page(b, p);
        orderSlots(bits_.data(), index_.data(), from.first.data(), from.alive, kRankMask,
                   p * kPageVertices, b.order.data());
    }
    b.version = version_;
}

std::vector<SplitBlocks::Join> SplitBlocks::joins() const {
    std::vector<Join> joins;
    for (uint32_t b = 0, last = 0; b != kNone; b = block_[last].next) {
        uint32_t count = block_[b].alive;
        last = b;
        for (uint32_t n = block_[b].next; n != kNone; last = n, n = block_[n].next) {
            const uint32_t more = block_[n].alive;
            if (more > 0 && count + more >= kFewVertices) break;
            count += more;
        }
        if (last != b) joins.push_back({b, last});
    }
    return joins;
}

void SplitBlocks::join(const Join& join) {
    Block& b = block_[join.first];
    const uint32_t after = block_[join.last].next;
    for (uint32_t n = b.next; n != after;) {
        Block& other = block_[n];
        n = other.next;
        for (uint32_t p = 0; p < other.page.size(); ++p) {
            const SplitPage& from = page(other, p);
            forBits(from.alive, [&](uint32_t i) {
                copyVertex(other, p * kPageVertices + i, b, add(b, from.first[i]));
            });
        }
        while (!other.page.empty()) dropPage(other);
        b.word_end = other.word_end;
        other = {};
        other.version = version_;
    }
    b.next = after;
    b.changed = true;
    if (after != kNone) block_[after].previous = join.first;
}

uint32_t SplitBlocks::newBlock() {
    if (free_blocks_.empty()) {
        block_.emplace_back();
        return uint32_t(block_.size()) - 1;
    }
    const uint32_t block = free_blocks_.back();
    free_blocks_.pop_back();
    return block;
}

/// Blocks of many vertices get neighbours of about as many, each of whole words; still empty ones.
std::vector<SplitBlocks::Cut> SplitBlocks::cuts(std::vector<uint32_t>& parts) {
    std::vector<Cut> cuts;
    for (uint32_t b = 0, next = 0; b != kNone; b = next) {
        next = block_[b].next;
        const uint32_t alive = block_[b].alive;
        if (alive <= kMostVertices) continue;
        const uint32_t each = alive / (alive / (kMostVertices * 3 / 4) + 1) + 1;
        const uint32_t end = block_[b].word_end;
        const size_t parts_begin = parts.size();
        uint32_t current = b, count = 0;
        for (uint32_t w = block_[b].word_begin; w < end; ++w) {
            if (count >= each) {
                const uint32_t part = newBlock();
                parts.push_back(part);
                block_[current].word_end = w;
                block_[current].next = part;
                block_[part].previous = std::exchange(current, part);
                block_[part].word_begin = w;
                count = 0;
            }
            count += uint32_t(std::popcount(bits_[w]));
        }
        block_[current].word_end = end;
        block_[current].next = next;
        if (next != kNone) block_[next].previous = current;
        if (parts.size() > parts_begin) cuts.push_back({b, parts_begin, parts.size()});
    }
    return cuts;
}

void SplitBlocks::cut(const Cut& cut, const std::vector<uint32_t>& parts) {
    Block& b = block_[cut.block];
    const auto begin = parts.begin() + ptrdiff_t(cut.parts_begin);
    const auto end = parts.begin() + ptrdiff_t(cut.parts_end);
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        SplitPage& from = page(b, p);
        forBits(from.alive, [&](uint32_t i) {
            const uint32_t word = from.first[i] / 64;
            if (word < b.word_end) return;
            const auto after = std::upper_bound(begin, end, word, [&](uint32_t w, uint32_t part) {
                return w < block_[part].word_begin;
            });
            Block& to = block_[*(after - 1)];
            copyVertex(b, p * kPageVertices + i, to, add(to, from.first[i]));
            for (const auto bits : {&SplitPage::alive, &SplitPage::opened, &SplitPage::grown})
                from.*bits &= ~(1u << i);
            --b.alive;
            b.first_free = std::min(b.first_free, p);
        });
    }
    b.changed = true;
    pack(b);
}

void SplitBlocks::commit() {
    ++version_;
    constexpr size_t kBatch = 4;
    const auto forChanged = [&](auto&& body) {
        parallelForSlices(block_.size(), kBatch, [&](size_t begin, size_t end) {
            for (size_t b = begin; b < end; ++b)
                if (block_[b].changed) body(uint32_t(b));
        });
    };
    forChanged([&](uint32_t b) { pack(block_[b]), setBits(block_[b]); });
    const std::vector<Join> joined = joins();
    for (const Join& j : joined)
        for (uint32_t n = block_[j.first].next; n != block_[j.last].next; n = block_[n].next)
            free_blocks_.push_back(n);
    parallelFor(joined.size(), [&](size_t i) { join(joined[i]); });
    std::vector<uint32_t> parts;
    const std::vector<Cut> cut_blocks = cuts(parts);
    parallelFor(cut_blocks.size(), [&](size_t i) { cut(cut_blocks[i], parts); });
    forChanged([&](uint32_t b) { number(b); });
    vertices_ = 0;
    for (Block& b : block_) {
        b.changed = false;
        vertices_ += b.alive;
    }
    // What was free all the time.
    least_free_ = std::min(least_free_, free_pages_.size());
    constexpr uint64_t kCommits = 64;
    if (version_ % kCommits == 0) giveBack(least_free_);
}

}  // namespace pietra::pmesh
