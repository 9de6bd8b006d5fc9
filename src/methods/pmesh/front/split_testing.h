#pragma once
// A LeafForest as nodes, packed as simply as can be: for tests.

#include <algorithm>
#include <deque>
#include <map>

#include "methods/pmesh/front/leaf_forest.h"

namespace pietra::pmesh {

class ForestPacker {
public:
    /// Nodes take at most so many splits.
    explicit ForestPacker(const LeafForest& forest, uint32_t most = kSplitSlots)
        : forest_(forest), most_(most) {}

    SplitForest pack() {
        out_.lattice = forest_.lattice;
        out_.grid = {forest_.grid_shift, forest_.grid_origin};
        end_.assign(forest_.leaves(), 0);
        for (size_t r = 0; r < forest_.root.size(); ++r) {
            const Leaf end =
                r + 1 < forest_.root.size() ? forest_.root[r + 1].first : Leaf(forest_.leaves());
            const LeafRoot& root = forest_.root[r];
            out_.base.root.push_back({vertexOf(root.vertex), end - root.first, kNoSplit});
            ranges(root.first, root.split, end);
        }
        for (size_t t = 0; t < forest_.base_corner.size() / 3; ++t)
            out_.base.triangle.push_back({forest_.base_corner[3 * t], forest_.base_corner[3 * t + 1],
                                          forest_.base_corner[3 * t + 2]});
        out_.base.closed.assign(out_.base.triangle.size(), 0);
        std::vector<Item> frontier;
        const auto flush = [&] {
            if (!frontier.empty() || out_.row.empty()) open(kNoNode, 0, std::move(frontier));
            frontier.clear();
        };
        for (size_t r = 0; r < forest_.root.size(); ++r) {
            const LeafRoot& root = forest_.root[r];
            if (root.split == kNoLeaf) continue;
            out_.base.root[r].split =
                splitId(NodeIndex(waiting_.size()), uint32_t(frontier.size()));
            frontier.push_back({root.split, root.first, root.vertex, root.criterion});
            if (frontier.size() == most_) flush();
        }
        flush();
        for (NodeIndex n = 0; n < waiting_.size(); ++n) fill(n);
        // A row states what its frontier does, which encloses all below.
        for (NodeIndex n = 0; n < out_.row.size(); ++n)
            for (size_t side = 0; side < 2; ++side)
                if (const NodeIndex c = out_.row[n].child[side]; c != kNoNode)
                    out_.node[n].child_criterion[side] = out_.row[c].criterion;
        return std::move(out_);
    }

private:
    struct Item {
        Leaf name, first;
        Vertex before;
        NestedCriterion criterion;
    };

    static SplitVertex vertexOf(const Vertex& v) { return {v.position(), uint16_t(v.normal)}; }
    /// Ends of the ranges that splits part.
    void ranges(Leaf first, Leaf split, Leaf end) {
        std::vector<std::array<Leaf, 3>> stack{{first, split, end}};
        while (!stack.empty()) {
            const auto [f, s, e] = stack.back();
            stack.pop_back();
            if (s == kNoLeaf) continue;
            end_[s] = e;
            stack.push_back({f, forest_.split[s].child[0], s});
            stack.push_back({s, forest_.split[s].child[1], e});
        }
    }
    NodeIndex open(NodeIndex parent, uint32_t level, std::vector<Item> frontier) {
        const auto n = NodeIndex(waiting_.size());
        waiting_.push_back(std::move(frontier));
        SplitRow row;
        row.parent = parent;
        row.level = uint16_t(level);
        out_.row.push_back(row);
        out_.node.emplace_back();
        return n;
    }
    void fill(NodeIndex n) {
        std::vector<Item> item = std::move(waiting_[n]);
        SplitNode node;
        node.frontier = uint32_t(item.size());
        NestedCriterion all;
        for (size_t i = 0; i < item.size(); ++i) {
            const NestedCriterion& c = item[i].criterion;
            if (i == 0) all = c;
            for (size_t k = 0; k < 3; ++k)
                all.min[k] = std::min(all.min[k], c.min[k]), all.max[k] = std::max(all.max[k], c.max[k]);
            all.error = std::max(all.error, c.error);
            all.normals.add(c.normals);
        }
        out_.row[n].criterion = all;
        std::vector<Item> beyond;
        std::vector<std::array<uint32_t, 2>> from;  // slot, end
        for (uint32_t s = 0; s < item.size(); ++s) {
            const Item it = item[s];
            const LeafSplit& from_split = forest_.split[it.name];
            VertexSplit split;
            split.leaves = {it.name - it.first, end_[it.name] - it.name};
            split.criterion = it.criterion;
            for (uint32_t end = 0; end < 2; ++end) {
                const Vertex& v = from_split.vertex[end];
                split.offset[end] = v.position() - it.before.position();
                split.normal[end] = uint16_t(v.normal);
                split.child[end] = kNoChildSplit;
                if (from_split.child[end] == kNoLeaf) continue;
                const Item child{from_split.child[end], end == 0 ? it.first : it.name, v,
                                 from_split.criterion[end]};
                if (item.size() < most_) {
                    split.child[end] = uint16_t(item.size());
                    item.push_back(child);
                } else {
                    beyond.push_back(child);
                    from.push_back({s, end});
                }
            }
            for (size_t t = 0; t < 2; ++t) bring(it, &from_split.corner[3 * t], split);
            node.split.push_back(split);
        }
        std::array<std::vector<Item>, 2> side;
        for (size_t i = 0; i < beyond.size(); ++i) {
            const size_t which = i < (beyond.size() + 1) / 2 ? 0 : 1;
            node.split[from[i][0]].child[from[i][1]] =
                uint16_t((which + 1) * kSplitSlots + side[which].size());
            side[which].push_back(beyond[i]);
        }
        out_.row[n].splits = uint32_t(node.split.size());
        for (size_t which = 0; which < 2; ++which)
            if (!side[which].empty()) {
                const NodeIndex child = open(n, out_.row[n].level + 1u, std::move(side[which]));
                out_.row[n].child[which] = child;
            }
        out_.node[n] = std::move(node);
    }
    void bring(const Item& it, const Leaf* corner, VertexSplit& split) const {
        if (corner[0] == corner[1]) return;
        const auto part = [&](Leaf leaf) {
            return leaf < it.first || leaf >= end_[it.name] ? 2 : leaf >= it.name ? 1 : 0;
        };
        for (size_t k = 0; k < 3; ++k) {
            if (part(corner[k]) != 2) continue;
            const Leaf a = corner[(k + 1) % 3], b = corner[(k + 2) % 3];
            const bool left = part(a) == 0;
            split.corner[left ? 0 : 1] = {(left ? a : b) - it.first, (left ? b : a) - it.name,
                                          int32_t(corner[k] - it.name)};
            split.brings |= left ? VertexSplit::kLeft : VertexSplit::kRight;
        }
    }

    const LeafForest& forest_;
    const uint32_t most_;
    SplitForest out_;
    std::vector<Leaf> end_;
    std::vector<std::vector<Item>> waiting_;
};

}  // namespace pietra::pmesh
