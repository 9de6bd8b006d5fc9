#include "methods/pmesh/front/split_front.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <utility>

namespace pietra::pmesh {
namespace {

constexpr size_t kBatch = 8;  ///< blocks of a task

int32_t trianglesOf(const std::array<Leaf, 6>& leaf) {
    return int32_t(leaf[0] != leaf[1]) + int32_t(leaf[3] != leaf[4]);
}

}  // namespace

SplitFront::SplitFront(const ResidentSplits& nodes)
    : nodes_(nodes),
      blocks_(nodes.leaves(), nodes.forest().layout.words()),
      triangles_(nodes.forest().base.triangle.size()) {
    const SplitBase& base = nodes.forest().base;
    const size_t words = blocks_.wordsAVertex();
    Leaf first = 0;
    for (size_t r = 0; r < base.root.size(); ++r) {
        const SplitBase::Root& root = base.root[r];
        Block& block = blocks_.all()[blocks_.blockOf(first)];
        const uint32_t slot = blocks_.add(block, first);
        const auto [page, i] = blocks_.at(block, slot);
        NestedCriterion ever;
        ever.error = NestedCriterion::kEver;
        page.birth.set(i, ever);
        page.next.set(i,
                      root.split != kNoSplit ? nodes.rootCriterion(root.split) : NestedCriterion());
        page.split[i] = root.split;
        page.made[i] = kNoSplit;
        page.last[i] = page.parent[i] = kNoLeaf;
        page.vertex[i] = root.vertex;
        page.leaf[i].fill(0);
        if (words) std::copy_n(&base.word[r * words], words, blocks_.wordsOf(block, slot));
        first += root.leaves;
        if (block.alive >= kMostInRound) blocks_.commit();
    }
    if (first > 0) blocks_.commit();
}

template <class Body>
void SplitFront::forBlocks(Body&& body) const {
    parallelForSlices(blocks_.all().size(), kBatch, [&](size_t begin, size_t end) {
        for (size_t b = begin; b < end; ++b) body(uint32_t(b));
    });
}

// ---- what is dropped

uint32_t SplitFront::mayOpen(const SplitPage& page, uint32_t needed) const {
    uint32_t open = 0;
    forBits(needed & page.alive, [&](uint32_t i) {
        if (mayOpen(page.split[i], page.next.get(i))) open |= 1u << i;
    });
    return open;
}

void SplitFront::decide(Block& b, const SplitView& view, Work& work) {
    b.dropping.clear();
    b.opening.clear();
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        SplitPage& page = blocks_.page(b, p);
        if (p + 1 < b.page.size())
            prefetchLines(&blocks_.page(b, p + 1), offsetof(SplitPage, split));
        const PageNeeds needs = scanPage(view, page);
        const uint32_t dropped = page.alive & ~needs.birth;
        if (dropped != 0) {
            page.dropped = dropped;
            page.alive &= needs.birth;
            b.dropping.push_back(uint16_t(p));
            b.first_free = std::min(b.first_free, p);
            b.alive -= uint32_t(std::popcount(dropped));
            work.merges += uint32_t(std::popcount(dropped));
            b.changed = true;
        }
        const uint32_t open = mayOpen(page, needs.next);
        if (open == 0) continue;
        page.opened = open;
        b.opening.push_back(uint16_t(p));
    }
}

size_t SplitFront::toDo(const SplitView& view) const {
    std::atomic<size_t> count = 0;
    forBlocks([&](uint32_t block) {
        const Block& b = blocks_.all()[block];
        size_t here = 0;
        for (uint32_t p = 0; p < b.page.size(); ++p) {
            const SplitPage& page = blocks_.page(b, p);
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
    const auto [page, i] = blocks_.at(blocks_.ownerOf(name));
    return page.first[i] == name && (page.alive >> i & 1) != 0;
}

/// Of all splits undone next to each other, the one that is above the others tells what v is.
void SplitFront::merge(uint32_t block, Work& work) {
    const Block& b = blocks_.all()[block];
    for (const uint16_t p : b.dropping) {
        const SplitPage& page = blocks_.page(b, p);
        forBits(page.dropped, [&](uint32_t i) {
            work.triangles -= trianglesOf(page.leaf[i]);
            if (page.parent[i] != kNoLeaf && !isAlive(page.parent[i])) return;
            Place v = blocks_.ownerOf(page.first[i]);
            for (;;) {
                if (v.rank == 0) {
                    v.block = blocks_.all()[v.block].previous;
                    v.rank = uint32_t(blocks_.countOf(v.block));
                }
                --v.rank;
                const auto [of_v, at_v] = blocks_.at(v);
                if (of_v.alive >> at_v & 1) break;
            }
            const uint32_t* words = nullptr;
            if (const size_t a_vertex = blocks_.wordsAVertex())
                words = blocks_.wordsOf(b, p * kPageVertices + i) + a_vertex;
            const Merge m{v,    page.made[i], page.parent[i], page.birth.get(i), page.merged[i],
                          words};
            if (v.block == block)
                applyMerge(m);
            else
                work.merge.push_back(m);
        });
    }
}

void SplitFront::applyMerge(const Merge& m) {
    Block& b = blocks_.all()[m.vertex.block];
    const uint32_t slot = b.order[m.vertex.rank];
    const auto [page, i] = blocks_.at(b, slot);
    page.split[i] = m.split;
    page.next.set(i, m.criterion);
    page.vertex[i] = m.merged;
    page.last[i] = m.last;
    if (m.words) std::copy_n(m.words, blocks_.wordsAVertex(), blocks_.wordsOf(b, slot));
    b.changed = true;
}

// ---- how much is to be split

/// How many splits the view asks for; no more than that they are more than `enough`.
size_t SplitFront::countSplits(const SplitView& view, size_t enough) const {
    std::atomic<size_t> count = 0;
    forBlocks([&](uint32_t block) {
        const Block& b = blocks_.all()[block];
        std::vector<SplitId> stack;
        for (const uint16_t p : b.opening) {
            if (count > enough) return;
            const SplitPage& page = blocks_.page(b, p);
            size_t here = 0;
            forBits(page.opened, [&](uint32_t i) {
                if (view.needs(page.next.get(i))) stack.push_back(page.split[i]);
                for (; !stack.empty() && here <= enough; ++here) {
                    const SplitId id = stack.back();
                    const ResidentSplit& s = nodes_.at(id);
                    const std::array<SplitId, 2> child = nodes_.childrenOf(id, s);
                    stack.pop_back();
                    for (const size_t k : {0u, 1u})
                        if (child[k] != kNoSplit && view.needs(s.criterion[k]) &&
                            mayOpen(child[k], s.criterion[k]))
                            stack.push_back(child[k]);
                }
            });
            count += here;
        }
    });
    return count;
}

/// The same, or one of a coarser tolerance: what that needs is a closed set, too.
SplitView SplitFront::withinLimits(const SplitView& view, const SplitLimits& limits,
                                   SplitCounts& counts) const {
    const size_t vertices = vertexCount() - counts.merges;
    const size_t room = limits.vertices - std::min(limits.vertices, vertices);
    const size_t most = std::min(room, limits.splits);
    const size_t roots = nodes_.forest().base.root.size();
    if (most >= nodes_.loaded() * kSplitSlots - (vertices - roots)) return view;
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
void SplitFront::reopen(Block& b, const SplitView& view) const {
    std::erase_if(b.opening, [&](uint16_t p) {
        SplitPage& page = blocks_.page(b, p);
        return (page.opened &= scanNext(view, page)) == 0;
    });
}

// ---- what is split

/// What has a new next split: is that needed?
void SplitFront::look(Block& b, const SplitView& view) const {
    for (const uint16_t p : b.grown) {
        SplitPage& page = blocks_.page(b, p);
        const uint32_t grown = std::exchange(page.grown, 0);
        uint32_t needed = 0;
        if (std::popcount(grown) > 2)
            needed = scanNext(view, page) & grown;
        else
            forBits(grown,
                    [&](uint32_t i) { needed |= uint32_t(view.needs(page.next.get(i))) << i; });
        const uint32_t open = mayOpen(page, needed);
        if (open != 0 && page.opened == 0) b.opening.push_back(p);
        page.opened |= open;
    }
    b.grown.clear();
}

void SplitFront::markGrown(Block& b, uint32_t slot) const {
    const auto [page, i] = blocks_.at(b, slot);
    if (page.grown == 0) b.grown.push_back(uint16_t(slot / kPageVertices));
    page.grown |= 1u << i;
}

/// In these blocks, until only what others have to do with is left, or there is too much. Together:
/// while splits of one come from memory, others go on.
void SplitFront::splitAll(size_t begin, size_t end, const SplitView& view, Work& work) {
    const std::span some(blocks_.all().begin() + ptrdiff_t(begin), end - begin);
    for (bool busy = true; busy;) {
        busy = false;
        for (Block& b : some) {
            look(b, view);
            if (b.opening.empty() || b.alive >= kMostInRound) continue;
            busy = true;
            for (const uint16_t p : b.opening) {
                const SplitPage& page = blocks_.page(b, p);
                forBits(page.opened, [&](uint32_t i) {
                    prefetchLines(&nodes_.at(page.split[i]), sizeof(ResidentSplit));
                });
            }
        }
        for (Block& b : some)
            if (!b.opening.empty() && b.alive < kMostInRound) splitOpened(b, work);
    }
}

void SplitFront::splitOpened(Block& b, Work& work) {
    const auto block = uint32_t(&b - blocks_.all().data());
    for (const uint16_t p : b.opening) {
        SplitPage& page = blocks_.page(b, p);
        forBits(std::exchange(page.opened, 0), [&](uint32_t i) {
            if (blocks_.blockOf(nodes_.at(page.split[i]).name) == block)
                applySplit(b, p * kPageVertices + i, b, work);
            else
                work.split.push_back({block, p * kPageVertices + i});
        });
    }
    b.opening.clear();
}

void SplitFront::applySplit(Block& b, uint32_t slot, Block& of_u, Work& work) {
    const auto [v, i] = blocks_.at(b, slot);
    const SplitId id = v.split[i];
    const ResidentSplit& split = nodes_.at(id);
    const uint32_t u_slot = blocks_.add(of_u, split.name);
    const auto [u, j] = blocks_.at(of_u, u_slot);
    const NestedCriterion own = v.next.get(i);
    u.birth.set(j, own);
    u.made[j] = id;
    u.merged[j] = v.vertex[i];
    u.parent[j] = v.last[i];
    u.leaf[j] = split.corner;
    u.closed |= uint32_t(split.closed()) << j;
    v.last[i] = u.last[j] = split.name;
    v.vertex[i] = split.vertex(0);
    u.vertex[j] = split.vertex(1);
    const std::array<SplitId, 2> child = nodes_.childrenOf(id, split);
    v.split[i] = child[0];
    u.split[j] = child[1];
    // A good file's are within.
    v.next.set(i, own.within(split.criterion[0]));
    u.next.set(j, own.within(split.criterion[1]));
    if (const size_t words = blocks_.wordsAVertex()) {
        uint32_t* const of_v = blocks_.wordsOf(b, slot);
        uint32_t* const to_u = blocks_.wordsOf(of_u, u_slot);
        const uint32_t* const after = nodes_.wordsOf(id);
        std::copy_n(of_v, words, to_u + words);
        std::copy_n(after, words, of_v);
        std::copy_n(after + words, words, to_u);
    }
    work.triangles += trianglesOf(split.corner);
    ++work.splits;
    b.changed = true;
    markGrown(b, slot);
    markGrown(of_u, u_slot);
}

/// Pages have changed.
void SplitFront::findBusy(Block& b) const {
    b.opening.clear();
    b.grown.clear();
    for (uint32_t p = 0; p < b.page.size(); ++p) {
        const SplitPage& page = blocks_.page(b, p);
        if (page.opened != 0) b.opening.push_back(uint16_t(p));
        if (page.grown != 0) b.grown.push_back(uint16_t(p));
    }
}

/// In an order that threads have no part in.
void SplitFront::splitAcross(PerThread<Work>& work) {
    std::vector<std::array<uint32_t, 2>> across;
    for (Work& w : work) {
        across.insert(across.end(), w.split.begin(), w.split.end());
        w.split.clear();
    }
    std::sort(across.begin(), across.end());
    for (const auto& [block, slot] : across) {
        Block& b = blocks_.all()[block];
        const auto [page, i] = blocks_.at(b, slot);
        const uint32_t of_u = blocks_.blockOf(nodes_.at(page.split[i]).name);
        applySplit(b, slot, blocks_.all()[of_u], work.local());
    }
}

SplitCounts SplitFront::adapt(const SplitView& keep, const SplitLimits& limits) {
    SplitCounts counts;
    may_block_ = nodes_.anyBlocks();
    std::vector<Block>& all = blocks_.all();
    PerThread<Work> work;
    forBlocks([&](uint32_t b) { decide(all[b], keep, work.local()); });
    forBlocks([&](uint32_t b) {
        if (!all[b].dropping.empty()) merge(b, work.local());
    });
    for (const Work& w : work) {
        for (const Merge& m : w.merge) applyMerge(m);
        counts.merges += w.merges;
    }
    const SplitView view = withinLimits(keep, limits, counts);
    if (view.reach != keep.reach) forBlocks([&](uint32_t b) { reopen(all[b], view); });
    const auto isBusy = [](const Block& b) { return !b.opening.empty() || !b.grown.empty(); };
    while (std::any_of(all.begin(), all.end(), isBusy)) {
        ++counts.rounds;
        if (std::any_of(all.begin(), all.end(),
                        [](const Block& b) { return b.alive >= kMostInRound; })) {
            blocks_.commit();
            forBlocks([&](uint32_t b) { findBusy(all[b]); });
        }
        parallelForSlices(all.size(), kBatch, [&](size_t begin, size_t end) {
            splitAll(begin, end, view, work.local());
        });
        splitAcross(work);
    }
    for (const Work& w : work) {
        counts.splits += w.splits;
        triangles_ += size_t(w.triangles);
    }
    if (std::any_of(all.begin(), all.end(), [](const Block& b) { return b.changed; }))
        blocks_.commit();
    return counts;
}

void SplitFront::arrived(std::span<const ResidentSplits::Arrived> arrived) {
    for (const ResidentSplits::Arrived& a : arrived) {
        const auto [page, i] = blocks_.at(blocks_.ownerOf(a.first));
        if (page.first[i] == a.first && page.split[i] == a.split)
            page.next.set(i, page.next.get(i).within(a.criterion));
    }
}

double SplitFront::largestError(const View& view) const {
    const SplitForest& forest = nodes_.forest();
    const SplitView one = splitView(view, forest.lattice, forest.grid, 1);
    PerThread<double> largest(0.0);
    forBlocks([&](uint32_t block) {
        double& most = largest.local();
        const Block& b = blocks_.all()[block];
        for (uint32_t p = 0; p < b.page.size(); ++p) {
            const SplitPage& page = blocks_.page(b, p);
            forBits(page.alive, [&](uint32_t i) {
                if (page.split[i] != kNoSplit)
                    most = std::max(most, one.pixelsOf(page.next.get(i)));
            });
        }
    });
    double most = 0;
    for (const double m : largest) most = std::max(most, m);
    return most;
}

}  // namespace pietra::pmesh
