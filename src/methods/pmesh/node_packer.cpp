#include "methods/pmesh/node_packer.h"

#include <algorithm>
#include <numeric>
#include <queue>
#include <unordered_map>

#include "base/check.h"

namespace pietra::pmesh {
namespace {

/// An operation with all that is below it.
struct Subtree {
    uint32_t operation;
    uint32_t count;
    Box3i box;
};

/// Levels of full nodes that so many operations fill.
uint32_t levelsFor(uint64_t operations) {
    uint32_t levels = 0;
    while (((uint64_t(1) << levels) - 1) * kNodeSlots < operations) ++levels;
    return levels;
}
uint64_t nodesFor(uint64_t operations) {
    return (operations + kNodeSlots - 1) / kNodeSlots;
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
        CHECK_LE(trees.size(), size_t(2 * kNodeSlots));
        return cutWithin(trees, trees.size() < kNodeSlots ? 1 : trees.size() - kNodeSlots);
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
    Packer(const Collapses& collapses, Packing& packing)
        : collapses_(collapses), packing_(packing) {
        packing_.maker.assign(collapses.vertices, kNoOperation);
    }

    void run() {
        std::vector<Subtree> all;
        for (const uint32_t record : collapses_.base_last)
            if (record != kNoOperation) all.push_back(subtree(record, link(record)));
        addRoots(std::move(all));  // of an empty model one node, without operations
        while (!waiting_.empty()) {
            const Waiting next = std::move(waiting_.front());
            waiting_.pop();
            fill(next);
        }
        for (const uint32_t record : collapses_.base_last) {
            const auto found = root_.find(record);
            packing_.base_operation.push_back(found == root_.end() ? kNoOperation : found->second);
        }
    }

private:
    struct Waiting {
        NodeIndex node;
        std::vector<uint32_t> frontier;
    };
    /// A record that the node being filled takes or refers to.
    struct Known {
        CollapseLink link;
        bool is_taken = false;
    };

    CollapseLink link(uint32_t record) const { return collapses_.store.link(record); }
    static Subtree subtree(uint32_t record, const CollapseLink& link) {
        return {record, link.operations, link.box};
    }
    void addRoots(std::vector<Subtree> trees);
    NodeIndex addNode(NodeIndex parent, std::span<const Subtree> frontier);
    void fill(const Waiting& waiting);
    void choose(const Waiting& waiting);
    /// One a reference.
    std::vector<uint8_t> sidesOf() {
        uint64_t operations = 0;
        for (const Subtree& tree : reference_) operations += tree.count;
        if (operations <= kNodeSlots || reference_.size() == 1)
            return std::vector<uint8_t>(reference_.size(), 0);
        return cutter_.cut(reference_);
    }

    const Collapses& collapses_;
    Packing& packing_;
    std::queue<Waiting> waiting_;
    std::unordered_map<uint32_t, OperationId> root_;
    Cutter cutter_;
    // Of the node being filled:
    std::unordered_map<uint32_t, Known> known_;
    std::vector<Subtree> reference_;  // beyond it
};

void Packer::addRoots(std::vector<Subtree> trees) {
    if (trees.size() <= kNodeSlots) {
        const NodeIndex node = addNode(kNoNode, trees);
        for (uint32_t s = 0; s < trees.size(); ++s)
            root_[trees[s].operation] = operationId(node, s);
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

NodeIndex Packer::addNode(NodeIndex parent, std::span<const Subtree> frontier) {
    const NodeIndex node = NodeIndex(packing_.row.size());
    NodeRow& row = packing_.row.emplace_back();
    row.parent = parent;
    row.level = parent == kNoNode ? uint16_t(0) : uint16_t(packing_.row[parent].level + 1);
    packing_.frontier.push_back(uint32_t(frontier.size()));
    Waiting waiting{node, {}};
    for (const Subtree& tree : frontier) waiting.frontier.push_back(tree.operation);
    waiting_.push(std::move(waiting));
    return node;
}

/// Numbers the slots: those referred to from above, then each as it is referred to.
void Packer::fill(const Waiting& waiting) {
    choose(waiting);
    std::vector<PackedSlot> slots;
    for (const uint32_t record : waiting.frontier) slots.push_back({record, 0});
    std::vector<std::array<uint32_t, 2>> beyond;  // slot and end of each reference
    reference_.clear();
    for (uint32_t s = 0; s < slots.size(); ++s) {
        const CollapseLink& link = known_.at(slots[s].record).link;
        if (link.u != kNoVertex) packing_.maker[link.u] = operationId(waiting.node, s);
        for (const uint32_t end : {0u, 1u}) {
            const uint32_t child = link.child[end];
            if (child == kNoOperation) continue;
            const Known& known = known_.at(child);
            if (known.is_taken) {
                slots[s].kinds |= 1u << (2 * end);
                slots.push_back({child, 0});
            } else {
                reference_.push_back(subtree(child, known.link));
                beyond.push_back({s, end});
            }
        }
    }
    const std::vector<uint8_t> side = sidesOf();
    for (size_t i = 0; i < side.size(); ++i)
        slots[beyond[i][0]].kinds |= (2u + side[i]) << (2 * beyond[i][1]);
    packing_.row[waiting.node].operations = uint32_t(slots.size());
    packing_.append(slots);
    for (const size_t which : {0u, 1u}) {
        std::vector<Subtree> part;
        for (size_t i = 0; i < side.size(); ++i)
            if (side[i] == which) part.push_back(reference_[i]);
        if (part.empty()) continue;
        const NodeIndex child = addNode(waiting.node, part);
        packing_.row[waiting.node].child[which] = child;
    }
}

/// Takes what fits into the node beside the frontier.
void Packer::choose(const Waiting& waiting) {
    known_.clear();
    std::priority_queue<std::pair<float, uint32_t>> next;
    const auto take = [&](Known& known) {
        known.is_taken = true;
        const CollapseLink taken = known.link;  // known_ may move
        for (const uint32_t c : taken.child) {
            if (c == kNoOperation) continue;
            const CollapseLink child = link(c);
            known_[c] = {child, false};
            next.push({child.error, c});
        }
    };
    CHECK_LE(waiting.frontier.size(), size_t(kNodeSlots));
    for (const uint32_t record : waiting.frontier) {
        Known& known = known_[record];
        known.link = link(record);
        take(known);
    }
    for (size_t room = kNodeSlots - waiting.frontier.size(); room > 0 && !next.empty(); --room) {
        const uint32_t record = next.top().second;
        next.pop();
        take(known_.at(record));
    }
}

}  // namespace

std::vector<PackedSlot> Packing::slots(NodeIndex node) const {
    std::vector<PackedSlot> slots(row[node].operations);
    slots_.read(begin_[node], std::as_writable_bytes(std::span(slots)));
    return slots;
}

void Packing::append(std::span<const PackedSlot> slots) {
    begin_.push_back(slots_.append(std::as_bytes(slots)));
}

void packCollapses(const Collapses& collapses, Packing& packing) {
    Packer(collapses, packing).run();
}

}  // namespace pietra::pmesh
