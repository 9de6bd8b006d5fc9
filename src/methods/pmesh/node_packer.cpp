#include "methods/pmesh/node_packer.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <queue>
#include <unordered_map>

#include "base/check.h"

namespace pietra::pmesh {
namespace {

/// An operation with all that is below it.
struct Subtree {
    uint32_t operation;
    Leaf first;
    uint32_t count;
    Box3i box;
};

/// Levels of full nodes that so many operations fill.
uint32_t levelsFor(uint64_t operations) {
    uint32_t levels = 0;
    while (((uint64_t(1) << levels) - 1) * kSplitSlots < operations) ++levels;
    return levels;
}
uint64_t nodesFor(uint64_t operations) {
    return (operations + kSplitSlots - 1) / kSplitSlots;
}

double areaOf(const Box3i& box) {
    const Vec3d d(Vec3l(box.max) - Vec3l(box.min));
    return d.x * d.y + d.y * d.z + d.z * d.x;
}

/// Sums over the first i subtrees of an order.
struct Prefix {
    std::vector<double> area;
    std::vector<uint64_t> count;

    template <class Iterator>
    void fill(Iterator begin, Iterator end, std::span<const Subtree> trees) {
        area.assign(1, 0.0);
        count.assign(1, 0);
        Box3i box;
        for (Iterator i = begin; i != end; ++i) {
            box.add(trees[*i].box);
            area.push_back(areaOf(box));
            count.push_back(count.back() + trees[*i].count);
        }
    }
};

/// Which side each of the subtrees goes to.
class Cutter {
public:
    const std::vector<uint8_t>& cut(std::span<const Subtree> trees) {
        CHECK_LE(size_t(2), trees.size());
        CHECK_LE(trees.size(), size_t(2 * kSplitSlots));
        return cutWithin(trees, trees.size() < kSplitSlots ? 1 : trees.size() - kSplitSlots);
    }
    /// Sides may have any number of subtrees, but none just a few: there are to be few roots.
    const std::vector<uint8_t>& cutFreely(std::span<const Subtree> trees) {
        return cutWithin(trees, trees.size() / 4);
    }

private:
    const std::vector<uint8_t>& cutWithin(std::span<const Subtree> trees, size_t least);

    std::vector<uint32_t> order_;
    Prefix left_, right_;
    std::vector<uint8_t> side_;
};

const std::vector<uint8_t>& Cutter::cutWithin(std::span<const Subtree> trees, size_t least) {
    const size_t n = trees.size();
    side_.assign(n, 0);
    double best = std::numeric_limits<double>::infinity();
    for (int axis = 0; axis < 3; ++axis) {
        const auto middle = [&](uint32_t i) {
            return trees[i].box.min[axis] + trees[i].box.max[axis];
        };
        order_.resize(n);
        std::iota(order_.begin(), order_.end(), 0u);
        std::stable_sort(order_.begin(), order_.end(),
                         [&](uint32_t a, uint32_t b) { return middle(a) < middle(b); });
        left_.fill(order_.begin(), order_.end(), trees);
        right_.fill(order_.rbegin(), order_.rend(), trees);
        size_t best_here = 0;
        for (size_t i = least; i <= n - least; ++i) {
            const uint64_t l = left_.count[i], r = right_.count[n - i];
            const double estimate =
                (left_.area[i] * levelsFor(l) + right_.area[n - i] * levelsFor(r)) *
                double(nodesFor(l) + nodesFor(r));
            if (estimate < best) best = estimate, best_here = i;
        }
        for (size_t i = 0; best_here > 0 && i < n; ++i) side_[order_[i]] = i >= best_here;
    }
    return side_;
}

class Packer {
public:
    Packer(const Collapses& collapses, Packing& packing, const LeafSink& leaves)
        : collapses_(collapses),
          links_(collapses.store.links()),
          packing_(packing),
          leaves_(leaves) {}

    void run() {
        std::vector<Subtree> all;
        Leaf first = 0;
        for (size_t v = 0; v < collapses_.base_last.size(); ++v) {
            const uint32_t record = collapses_.base_last[v];
            leaves_(collapses_.base_vertex[v], first);
            uint32_t leaves = 1;
            if (record != kNoSplit) {
                all.push_back(subtree(record, first, link(record)));
                leaves += all.back().count;
            }
            packing_.base_leaves.push_back(leaves);
            first += leaves;
        }
        addRoots(std::move(all));  // of an empty model one node, without splits
        for (NodeIndex n = 0; n < packing_.size(); ++n) fill(n);
        for (const uint32_t record : collapses_.base_last) {
            const auto found = root_.find(record);
            packing_.base_split.push_back(found == root_.end() ? kNoSplit : found->second);
        }
    }

private:
    /// A record that the node being filled takes or refers to.
    struct Known {
        CollapseLink link;
        bool is_taken = false;
    };

    const CollapseLink& link(uint32_t record) { return links_[record]; }
    static Subtree subtree(uint32_t record, Leaf first, const CollapseLink& link) {
        return {record, first, link.operations, link.box};
    }
    void addRoots(std::vector<Subtree> trees);
    NodeIndex addNode(NodeIndex parent, uint32_t level, std::span<const Subtree> frontier);
    void fill(NodeIndex n);
    void choose(std::span<const PackedSlot> frontier);
    /// One a reference.
    std::vector<uint8_t> sidesOf() {
        uint64_t operations = 0;
        for (const Subtree& tree : reference_) operations += tree.count;
        if (operations <= kSplitSlots || reference_.size() == 1)
            return std::vector<uint8_t>(reference_.size(), 0);
        return cutter_.cut(reference_);
    }

    const Collapses& collapses_;
    CachedRecords<CollapseLink> links_;
    Packing& packing_;
    const LeafSink& leaves_;
    std::unordered_map<uint32_t, SplitId> root_;
    Cutter cutter_;
    // Of the node being filled:
    std::unordered_map<uint32_t, Known> known_;
    std::vector<Subtree> reference_;  // beyond it
};

void Packer::addRoots(std::vector<Subtree> trees) {
    if (trees.size() <= kSplitSlots) {
        const NodeIndex node = addNode(kNoNode, 0, trees);
        for (uint32_t s = 0; s < trees.size(); ++s) root_[trees[s].operation] = splitId(node, s);
        return;
    }
    const std::vector<uint8_t> side = cutter_.cutFreely(trees);
    for (const size_t which : {0u, 1u}) {
        std::vector<Subtree> part;
        for (size_t i = 0; i < trees.size(); ++i)
            if (side[i] == which) part.push_back(trees[i]);
        addRoots(std::move(part));
    }
}

NodeIndex Packer::addNode(NodeIndex parent, uint32_t level, std::span<const Subtree> frontier) {
    const NodeIndex n = packing_.size();
    PackedNode node;
    node.row.parent = parent;
    node.row.level = uint16_t(level);
    node.frontier = uint32_t(frontier.size());
    for (const Subtree& tree : frontier) node.slot.push_back({tree.operation, tree.first, 0});
    packing_.put(n, node);
    return n;
}

/// Numbers the slots: those referred to from above, then each as it is referred to.
void Packer::fill(NodeIndex n) {
    PackedNode node = packing_.node(n);
    std::vector<PackedSlot>& slots = node.slot;
    choose(slots);
    std::vector<std::array<uint32_t, 2>> beyond;  // slot and end of each reference
    reference_.clear();
    for (uint32_t s = 0; s < slots.size(); ++s) {
        const CollapseLink& link = known_.at(slots[s].record).link;
        const uint32_t below_v =
            link.child[0] == kNoSplit ? 0 : known_.at(link.child[0]).link.operations;
        const Leaf name = slots[s].first + below_v + 1;
        leaves_(link.u, name);
        for (const uint32_t end : {0u, 1u}) {
            const uint32_t child = link.child[end];
            if (child == kNoSplit) continue;
            const Known& known = known_.at(child);
            if (known.is_taken) {
                slots[s].kinds |= 1u << (2 * end);
                slots.push_back({child, end == 0 ? slots[s].first : name, 0});
            } else {
                reference_.push_back(subtree(child, end == 0 ? slots[s].first : name, known.link));
                beyond.push_back({s, end});
            }
        }
    }
    const std::vector<uint8_t> side = sidesOf();
    for (size_t i = 0; i < side.size(); ++i)
        slots[beyond[i][0]].kinds |= (2u + side[i]) << (2 * beyond[i][1]);
    node.row.splits = uint32_t(slots.size());
    for (const size_t which : {0u, 1u}) {
        std::vector<Subtree> part;
        for (size_t i = 0; i < side.size(); ++i)
            if (side[i] == which) part.push_back(reference_[i]);
        if (!part.empty()) node.row.child[which] = addNode(n, node.row.level + 1u, part);
    }
    packing_.put(n, node);
}

/// Takes what fits into the node beside the frontier.
void Packer::choose(std::span<const PackedSlot> frontier) {
    known_.clear();
    std::priority_queue<std::pair<float, uint32_t>> next;
    const auto take = [&](Known& known) {
        known.is_taken = true;
        const CollapseLink taken = known.link;  // known_ may move
        for (const uint32_t c : taken.child) {
            if (c == kNoSplit) continue;
            const CollapseLink child = link(c);
            known_[c] = {child, false};
            next.push({child.error, c});
        }
    };
    CHECK_LE(frontier.size(), size_t(kSplitSlots));
    for (const PackedSlot& slot : frontier) {
        Known& known = known_[slot.record];
        known.link = link(slot.record);
        take(known);
    }
    for (size_t room = kSplitSlots - frontier.size(); room > 0 && !next.empty(); --room) {
        const uint32_t record = next.top().second;
        next.pop();
        take(known_.at(record));
    }
}

}  // namespace

PackedNode Packing::node(NodeIndex n) const {
    Head head;
    nodes_.read(n * kBytes, std::as_writable_bytes(std::span(&head, 1)));
    PackedNode node{head.row, head.frontier, std::vector<PackedSlot>(head.slots)};
    nodes_.read(n * kBytes + sizeof head, std::as_writable_bytes(std::span(node.slot)));
    return node;
}

void Packing::put(NodeIndex n, const PackedNode& node) {
    CHECK_LE(n, size_);
    std::vector<std::byte> bytes(kBytes);
    const Head head{node.row, node.frontier, uint32_t(node.slot.size())};
    std::memcpy(bytes.data(), &head, sizeof head);
    std::ranges::copy(std::as_bytes(std::span(node.slot)), bytes.begin() + sizeof head);
    nodes_.write(n * kBytes, bytes);
    size_ = std::max(size_, n + 1);
}

void packCollapses(const Collapses& collapses, Packing& packing, const LeafSink& leaves) {
    Packer(collapses, packing, leaves).run();
}

}  // namespace pietra::pmesh
