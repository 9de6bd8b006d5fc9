#include "methods/pmesh/front/resident_splits.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace pietra::pmesh {

void ResidentSplits::Blocking::clear() {
    for (size_t k = 0; k < 3; ++k) min[k].clear(), max[k].clear();
    error.clear();
}

void ResidentSplits::Blocking::add(const NestedCriterion& c) {
    for (size_t k = 0; k < 3; ++k) min[k].push_back(c.min[k]), max[k].push_back(c.max[k]);
    error.push_back(c.error);
}

ResidentSplits::ResidentSplits(SplitForest forest, uint32_t most)
    : forest_(std::move(forest)),
      state_(forest_.row.size()),
      node_(forest_.row.size()),
      split_(forest_.row.size()),
      most_(most),
      limit_(most) {
    std::vector<std::vector<Reference>> above;
    std::vector<std::vector<SplitVertex>> before;
    for (const SplitBase::Root& root : forest_.base.root) {
        const Leaf first = std::exchange(leaves_, leaves_ + root.leaves);
        if (root.split == kNoSplit) continue;
        const NodeIndex n = nodeOfSplit(root.split);
        if (above.size() <= n) above.resize(n + 1), before.resize(n + 1);
        const uint32_t slot = slotOfSplit(root.split);
        CHECK_EQ(slot, above[n].size());
        above[n].push_back({first, root.leaves, 0, 0});
        before[n].push_back(root.vertex);
    }
    above.resize(std::max<size_t>(above.size(), 1));
    before.resize(above.size());
    for (NodeIndex n = 0; n < forest_.row.size() && forest_.row[n].parent == kNoNode; ++n) {
        auto loaded = placed(n, forest_.node[n], above[n], before[n]);
        CHECK(loaded != nullptr);
        keep(n, std::move(loaded));
        root_criterion_.resize(splitId(n + 1, 0));
        for (uint32_t s = 0; s < forest_.node[n].frontier; ++s)
            root_criterion_[splitId(n, s)] =
                forest_.node[n].split[s].criterion.at(before[n][s].position, forest_.grid);
    }
    forest_.node = {};
}

/// Null where it does not fit what refers to it.
std::unique_ptr<ResidentSplits::Loaded> ResidentSplits::placed(
    NodeIndex index, const SplitNode& node, std::span<const Reference> above,
    std::span<const SplitVertex> before) const {
    if (node.frontier != above.size()) return nullptr;
    auto loaded = std::make_unique<Loaded>();
    const size_t count = node.split.size();
    loaded->split = std::make_unique<ResidentSplit[]>(count);
    loaded->word = node.word;
    loaded->child_parts = node.child_parts;
    const NestedCriterion row = forest_.row[index].criterion;
    std::vector<Leaf> first(count);
    std::vector<SplitVertex> from(count);
    for (uint32_t s = 0; s < node.frontier; ++s) {
        const VertexSplit& split = node.split[s];
        if (uint64_t(split.leaves[0]) + split.leaves[1] != above[s].leaves) return nullptr;
        first[s] = above[s].first;
        from[s] = before[s];
    }
    for (uint32_t s = 0; s < count; ++s) {
        const VertexSplit& split = node.split[s];
        ResidentSplit& to = loaded->split[s];
        to.name = first[s] + split.leaves[0];
        to.corner.fill(0);
        for (size_t t = 0; t < 2; ++t) {
            if ((split.brings >> t & 1) == 0) continue;
            const VertexSplit::Corners& c = split.corner[t];
            const Leaf v = first[s] + c.v, u = to.name + c.u, w = to.name + uint32_t(c.w);
            if (v >= leaves_ || u >= leaves_ || w >= leaves_) return nullptr;
            to.corner[3 * t] = t == 0 ? v : u;
            to.corner[3 * t + 1] = t == 0 ? u : v;
            to.corner[3 * t + 2] = w;
        }
        for (uint16_t end = 0; end < 2; ++end) {
            // Wherever damage takes it, it is a number.
            for (int k = 0; k < 3; ++k)
                to.position[end][k] =
                    int32_t(uint32_t(from[s].position[k]) + uint32_t(split.offset[end][k]));
            to.normal[end] = split.normal[end];
            to.child[end] = split.child[end];
            to.criterion[end] = {};
            if (split.child[end] == kNoChildSplit) continue;
            const uint32_t where = split.child[end] / kSplitSlots;
            const uint32_t slot = split.child[end] % kSplitSlots;
            if (where == 0) {
                to.criterion[end] = node.split[slot].criterion.at(to.position[end], forest_.grid);
                first[slot] = end == 0 ? first[s] : to.name;
                from[slot] = to.vertex(end);
            } else {
                to.criterion[end] = row;
                loaded->reference[where - 1].push_back(
                    {end == 0 ? first[s] : to.name, split.leaves[end], uint16_t(s), end});
            }
        }
        if ((split.brings & VertexSplit::kClosed) != 0) to.child[0] |= ResidentSplit::kClosed;
    }
    return loaded;
}

void ResidentSplits::keep(NodeIndex index, std::unique_ptr<Loaded> loaded) {
    loaded->position = uint32_t(loaded_.size());
    loaded_.push_back(index);
    split_[index] = loaded->split.get();
    node_[index] = std::move(loaded);
}

void ResidentSplits::look(const SplitView& view) {
    ++frame_;
    victims_.reset();
    blocking_.clear();
    std::vector<NodeIndex> asked;
    // Down from the roots: only below what is wanted is anything wanted.
    std::vector<NodeIndex> wanted;
    for (NodeIndex n = 0; n < forest_.row.size() && forest_.row[n].parent == kNoNode; ++n)
        wanted.push_back(n);
    for (size_t i = 0; i < wanted.size(); ++i) {
        const NodeIndex n = wanted[i];
        state_[n].last_used = frame_;
        for (const size_t side : {0u, 1u}) {
            const NodeIndex c = forest_.row[n].child[side];
            if (c == kNoNode || !view.needs(forest_.row[c].criterion)) continue;
            const auto& parts = node_[n]->child_parts[side];
            const auto needed = [&](const NestedCriterion& part) { return view.needs(part); };
            if (isLoaded(c)) {
                if (std::any_of(parts.begin(), parts.end(), needed)) wanted.push_back(c);
                continue;
            }
            const size_t before = blocking_.error.size();
            for (const NestedCriterion& part : parts)
                if (needed(part)) blocking_.add(part);
            if (blocking_.error.size() > before && !state_[c].is_bad) asked.push_back(c);
        }
    }
    wanted_ = wanted.size();
    std::sort(asked.begin(), asked.end());
    for (const NodeIndex n : asked_)
        if (!std::binary_search(asked.begin(), asked.end(), n)) state_[n].asked = 0;
    for (const NodeIndex n : asked) ++state_[n].asked;
    asked_ = std::move(asked);
}

bool ResidentSplits::isBlocked(const NestedCriterion& c) const {
    const size_t count = blocking_.error.size();
    uint32_t found = 0;
    for (size_t i = 0; i < count; ++i) {
        uint16_t within = uint16_t(blocking_.error[i] >= c.error);
        for (size_t k = 0; k < 3; ++k)
            within &=
                uint16_t((blocking_.min[k][i] <= c.min[k]) & (blocking_.max[k][i] >= c.max[k]));
        found |= within;
    }
    return found != 0;
}

std::vector<NestedCriterion> ResidentSplits::blocking() const {
    std::vector<NestedCriterion> all(blocking_.error.size());
    for (size_t i = 0; i < all.size(); ++i) {
        for (size_t k = 0; k < 3; ++k)
            all[i].min[k] = blocking_.min[k][i], all[i].max[k] = blocking_.max[k][i];
        all[i].error = blocking_.error[i];
    }
    return all;
}

std::vector<NodeIndex> ResidentSplits::requests(size_t most) const {
    std::vector<NodeIndex> nodes;
    for (const NodeIndex n : asked_)
        if (!isLoaded(n) && !state_[n].is_bad) nodes.push_back(n);
    std::stable_sort(nodes.begin(), nodes.end(),
                     [&](NodeIndex a, NodeIndex b) { return state_[a].asked > state_[b].asked; });
    nodes.resize(std::min(most, nodes.size()));
    return nodes;
}

std::vector<NodeIndex> ResidentSplits::prefetch(const SplitView& view, size_t most) {
    size_t room = most_ - std::min<size_t>(most_, loaded());
    for (const NodeIndex n : loaded_)
        room += state_[n].last_used + kFramesKept < frame_ && forest_.row[n].parent != kNoNode;
    most = std::min(most, room);
    // Down from the roots, level by level: rows lie so.
    std::vector<NodeIndex> nodes, level;
    for (NodeIndex n = 0; n < forest_.row.size() && forest_.row[n].parent == kNoNode; ++n)
        level.push_back(n);
    while (!level.empty() && nodes.size() < most) {
        std::vector<NodeIndex> next;
        for (const NodeIndex n : level)
            for (const NodeIndex c : forest_.row[n].child) {
                if (c == kNoNode || state_[c].is_bad || !view.needs(forest_.row[c].criterion))
                    continue;
                if (!isLoaded(c) && nodes.size() < most) nodes.push_back(c);
                next.push_back(c);
            }
        level = std::move(next);
    }
    return nodes;
}

std::optional<std::vector<ResidentSplits::Arrived>> ResidentSplits::arrive(NodeIndex index,
                                                                           const SplitNode& node) {
    const NodeIndex parent = forest_.row[index].parent;
    if (isLoaded(index) || state_[index].is_bad || parent == kNoNode || !isLoaded(parent))
        return {};
    if (!makeRoom() || !isLoaded(parent)) return {};
    Loaded& above = *node_[parent];
    const size_t side = forest_.row[parent].child[0] == index ? 0 : 1;
    std::vector<SplitVertex> before;
    for (const Reference& r : above.reference[side])
        before.push_back(above.split[r.slot].vertex(r.end));
    auto loaded = placed(index, node, above.reference[side], before);
    if (!loaded) return giveUp(index), std::nullopt;
    std::vector<Arrived> arrived;
    for (uint32_t s = 0; s < node.frontier; ++s) {
        const Reference& r = above.reference[side][s];
        const NestedCriterion criterion =
            node.split[s].criterion.at(before[s].position, forest_.grid);
        above.split[r.slot].criterion[r.end] = criterion;
        arrived.push_back({r.first, splitId(index, s), criterion});
    }
    keep(index, std::move(loaded));
    ++state_[parent].loaded_children;
    state_[index].asked = 0;
    state_[index].last_used = frame_;
    return arrived;
}

bool ResidentSplits::makeRoom() {
    while (loaded() >= most_)
        if (!evictOldest()) return false;
    return true;
}

bool ResidentSplits::evictOldest() {
    if (!victims_) {
        victims_.emplace();
        for (const NodeIndex n : loaded_)
            if (forest_.row[n].parent != kNoNode && state_[n].last_used != frame_)
                victims_->push_back(n);
        // Below one that was not used nothing was.
        std::sort(victims_->begin(), victims_->end(), [&](NodeIndex a, NodeIndex b) {
            return std::pair(state_[a].last_used, b) > std::pair(state_[b].last_used, a);
        });
    }
    while (!victims_->empty()) {
        const NodeIndex n = victims_->back();
        victims_->pop_back();
        if (!mayLeave(n)) continue;
        evict(n);
        return true;
    }
    return false;
}

void ResidentSplits::evict(NodeIndex index) {
    const uint32_t position = node_[index]->position;
    loaded_[position] = loaded_.back();
    node_[loaded_[position]]->position = position;
    loaded_.pop_back();
    node_[index].reset();
    split_[index] = nullptr;
    --state_[forest_.row[index].parent].loaded_children;
}

}  // namespace pietra::pmesh
