#include "methods/pmesh/node_packer.h"

#include <algorithm>
#include <numeric>
#include <queue>

#include "base/check.h"

namespace pietra::pmesh {
namespace {

/// Of an operation without a place: the node that is being filled will take it.
constexpr OperationId kChosen = kNoOperation - 1;

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
    /// Sides may have any number of subtrees.
    const std::vector<uint8_t>& cutFreely(std::span<const Subtree> trees) {
        return cutWithin(trees, 1);
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
    Packer(std::span<PackOperation> operations, Packing& packing)
        : operation_(operations), packing_(packing) {
        packing_.id_of.assign(operations.size(), kNoOperation);
        count_.assign(operations.size(), 1);
        for (size_t i = operations.size(); i-- > 0;)
            for (const uint32_t c : operations[i].child) {
                if (c == kNoOperation) continue;
                CHECK_LT(i, size_t(c));
                count_[i] += count_[c];
                operations[i].box.add(operations[c].box);
                operations[i].error = std::max(operations[i].error, operations[c].error);
            }
    }

    void run(std::span<const uint32_t> roots) {
        std::vector<Subtree> all;
        for (const uint32_t o : roots) all.push_back(subtree(o));
        if (!all.empty()) addRoots(std::move(all));
        while (!waiting_.empty()) {
            const Waiting next = std::move(waiting_.front());
            waiting_.pop();
            fill(next);
        }
    }

private:
    struct Waiting {
        NodeIndex node;
        std::vector<uint32_t> frontier;
    };

    Subtree subtree(uint32_t o) const { return {o, count_[o], operation_[o].box}; }
    void addRoots(std::vector<Subtree> trees);
    NodeIndex addNode(NodeIndex parent, std::span<const Subtree> frontier);
    void fill(const Waiting& waiting);
    void choose(const Waiting& waiting);
    void addChildren(NodeIndex node);

    std::span<PackOperation> operation_;
    Packing& packing_;
    std::vector<uint32_t> count_;
    std::queue<Waiting> waiting_;
    Cutter cutter_;
    std::vector<uint32_t> slots_;     // of the node being filled
    std::vector<Subtree> reference_;  // beyond it
};

void Packer::addRoots(std::vector<Subtree> trees) {
    if (trees.size() <= kNodeSlots) {
        addNode(kNoNode, trees);
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
    Waiting waiting{node, {}};
    for (const Subtree& tree : frontier) waiting.frontier.push_back(tree.operation);
    waiting_.push(std::move(waiting));
    return node;
}

/// Numbers the slots: those referred to from above, then each as it is referred to.
void Packer::fill(const Waiting& waiting) {
    choose(waiting);
    const NodeIndex node = waiting.node;
    slots_ = waiting.frontier;
    reference_.clear();
    for (size_t slot = 0; slot < slots_.size(); ++slot) {
        packing_.id_of[slots_[slot]] = operationId(node, uint32_t(slot));
        for (const uint32_t c : operation_[slots_[slot]].child) {
            if (c == kNoOperation) continue;
            if (packing_.id_of[c] == kChosen) {
                slots_.push_back(c);
            } else {
                reference_.push_back(subtree(c));
            }
        }
    }
    packing_.row[node].operations = uint32_t(slots_.size());
    addChildren(node);
}

/// Marks what fits into the node beside the frontier.
void Packer::choose(const Waiting& waiting) {
    const auto less = [&](uint32_t a, uint32_t b) {
        return operation_[a].error != operation_[b].error
                   ? operation_[a].error < operation_[b].error
                   : a > b;
    };
    std::priority_queue<uint32_t, std::vector<uint32_t>, decltype(less)> next(less);
    const auto open = [&](uint32_t o) {
        for (const uint32_t c : operation_[o].child)
            if (c != kNoOperation) next.push(c);
    };
    CHECK_LE(waiting.frontier.size(), size_t(kNodeSlots));
    for (const uint32_t o : waiting.frontier) open(o);
    for (size_t room = kNodeSlots - waiting.frontier.size(); room > 0 && !next.empty(); --room) {
        const uint32_t o = next.top();
        next.pop();
        packing_.id_of[o] = kChosen;
        open(o);
    }
}

void Packer::addChildren(NodeIndex node) {
    if (reference_.empty()) return;
    uint64_t operations = 0;
    for (const Subtree& tree : reference_) operations += tree.count;
    if (operations <= kNodeSlots || reference_.size() == 1) {
        packing_.row[node].child[0] = addNode(node, reference_);
        return;
    }
    const std::vector<uint8_t>& side = cutter_.cut(reference_);
    for (const size_t which : {0u, 1u}) {
        std::vector<Subtree> part;
        for (size_t i = 0; i < reference_.size(); ++i)
            if (side[i] == which) part.push_back(reference_[i]);
        const NodeIndex child = addNode(node, part);
        packing_.row[node].child[which] = child;
    }
}

}  // namespace

Packing packOperations(std::span<PackOperation> operations, std::span<const uint32_t> roots) {
    Packing packing;
    Packer(operations, packing).run(roots);
    return packing;
}

}  // namespace pietra::pmesh
