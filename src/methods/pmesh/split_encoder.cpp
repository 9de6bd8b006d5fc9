#include "methods/pmesh/split_encoder.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "methods/pmesh/node_packer.h"
#include "methods/pmesh/wing_leaves.h"

namespace pietra::pmesh {
namespace {

/// The finest that has room for all boxes.
SplitGrid gridOf(const Box3i& box) {
    SplitGrid grid;
    if (box.empty()) return grid;
    grid.origin = box.min;
    const Vec3i size = box.max - box.min;
    const int32_t longest = std::max({size.x, size.y, size.z});
    while (((longest - 1) >> grid.shift) + 1 > 0xffff) ++grid.shift;
    return grid;
}

/// What a frontier states: large errors, which are few, apart from small ones, and these by place.
std::vector<NestedCriterion> partsOf(std::span<const NestedCriterion> frontier) {
    constexpr std::array<uint32_t, 4> kShare{16, 4, 2, 1};  // of errors: this part, beyond the last
    constexpr size_t kWhole = 24;                           // splits that are not parted
    std::vector<NestedCriterion> parts;
    std::vector<uint32_t> order(frontier.size());
    std::iota(order.begin(), order.end(), 0u);
    const auto criterion = [&](uint32_t i) -> const NestedCriterion& { return frontier[i]; };
    const auto join = [&](std::span<uint32_t> some) {
        NestedCriterion c = criterion(some[0]);
        for (const uint32_t i : some) c = c.joined(criterion(i));
        return c;
    };
    const auto halve = [&](std::span<uint32_t> some) {
        const NestedCriterion all = join(some);
        size_t axis = 0;
        for (size_t k = 1; k < 3; ++k)
            if (all.max[k] - all.min[k] > all.max[axis] - all.min[axis]) axis = k;
        const auto key = [&](uint32_t i) {
            return std::pair(uint32_t(criterion(i).min[axis]) + criterion(i).max[axis], i);
        };
        std::nth_element(some.begin(), some.begin() + ptrdiff_t(some.size() / 2), some.end(),
                         [&](uint32_t a, uint32_t b) { return key(a) < key(b); });
        return std::array{some.first(some.size() / 2), some.subspan(some.size() / 2)};
    };
    std::sort(order.begin(), order.end(), [&](uint32_t a, uint32_t b) {
        return std::pair(criterion(b).error, a) < std::pair(criterion(a).error, b);
    });
    size_t begin = 0;
    for (const uint32_t share : kShare) {
        const size_t end = frontier.size() / share;
        const auto some = std::span(order).subspan(begin, end - begin);
        if (share > 1 && some.size() < kWhole) continue;
        begin = end;
        if (some.empty()) continue;
        if (some.size() < kWhole) {
            parts.push_back(join(some));
            continue;
        }
        for (const auto& half : halve(some))
            for (const auto& quarter : halve(half)) parts.push_back(join(quarter));
    }
    return parts;
}

class Encoder {
public:
    Encoder(const Collapses& collapses, TempSpace& space, BuildCounts& counts,
            const SplitSink& sink, SplitForest& forest)
        : collapses_(collapses),
          packing_(space),
          shapes_(collapses.store.shapes()),
          wings_(collapses.store.wings()),
          wing_leaves_(collapses, space),
          parts_(space),
          counts_(counts),
          sink_(sink),
          forest_(forest) {}

    void run() {
        packCollapses(collapses_, packing_, [&](VertexId v, Leaf first) {
            wing_leaves_.add(v, first);
            if (!counts_.leaf_of.empty()) counts_.leaf_of[v] = first;
        });
        wing_leaves_.find();
        makeBase();
        for (NodeIndex n = packing_.size(); n-- > 0;) encodeNode(n);
    }

private:
    void makeBase();
    void encodeNode(NodeIndex n);
    VertexSplit encodeSplit(const PackedSlot& slot, const CollapseShape& r);
    NestedCriterion criterionOf(const CollapseShape& r) const;

    const Collapses& collapses_;
    Packing packing_;
    CachedRecords<CollapseShape> shapes_;
    CachedRecords<Wings> wings_;
    WingLeaves wing_leaves_;
    Spill parts_;  ///< of each node, as its parent will have them
    BuildCounts& counts_;
    const SplitSink& sink_;
    SplitForest& forest_;
};

void Encoder::makeBase() {
    const Mesh& base = collapses_.base;
    forest_.layout = WordLayout::of(base);
    Box3i box;
    std::vector<Leaf> first(base.vertexCount());
    for (uint32_t v = 0; v < base.vertexCount(); ++v) {
        first[v] = v == 0 ? 0 : first[v - 1] + packing_.base_leaves[v - 1];
        const Vec3i position = base.position[v] >> forest_.lattice.shift;
        box.add(position);
        forest_.base.root.push_back({{position, packNormal(base.normal[v])},
                                     packing_.base_leaves[v],
                                     packing_.base_split[v]});
        appendWords(base, v, forest_.layout, forest_.base.word);
        // It encloses all that is below.
        if (collapses_.base_last[v] != kNoSplit) box.add(shapes_[collapses_.base_last[v]].box);
    }
    for (size_t t = 0; t < base.triangleCount(); ++t) {
        std::array<Leaf, 3> corner;
        for (size_t k = 0; k < 3; ++k)
            corner[k] = first[base.triangle[t][k]] + collapses_.base_leaves[t][k];
        forest_.base.triangle.push_back(corner);
    }
    forest_.base.closed = collapses_.base_closed;
    forest_.grid = gridOf(box);
}

/// Rounded outwards; so what is nested remains so.
NestedCriterion Encoder::criterionOf(const CollapseShape& r) const {
    const SplitGrid& grid = forest_.grid;
    const Vec3i min = r.box.min - grid.origin, max = r.box.max - grid.origin;
    const int32_t up = (1 << grid.shift) - 1;
    NestedCriterion c;
    for (int k = 0; k < 3; ++k) {
        c.min[size_t(k)] = uint16_t(min[k] >> grid.shift);
        c.max[size_t(k)] = uint16_t((max[k] + up) >> grid.shift);
    }
    c.error = NestedCriterion::errorUp(float(double(r.error) / grid.unit(forest_.lattice)));
    c.normals = r.normals;
    return c;
}

VertexSplit Encoder::encodeSplit(const PackedSlot& slot, const CollapseShape& r) {
    VertexSplit split;
    split.child = {kNoChildSplit, kNoChildSplit};
    split.leaves = r.leaves;
    const Leaf name = slot.first + r.leaves[0];
    const Wings wings = wings_[slot.record];
    const std::array<Leaf, 2> third = wing_leaves_.of(slot.record);
    for (const size_t side : {0u, 1u}) {
        if (wings[side].vertex == kNoVertex) continue;
        split.brings |= side == 0 ? VertexSplit::kLeft : VertexSplit::kRight;
        split.corner[side] = {wings[side].offset[0], wings[side].offset[1],
                              int32_t(third[side] - name)};
    }
    if (r.closed) split.brings |= VertexSplit::kClosed;
    split.normal = r.normal;
    for (const size_t end : {0u, 1u}) split.offset[end] = r.position[end] - r.merged;
    split.criterion = LocalCriterion::of(criterionOf(r), r.merged, forest_.grid);
    return split;
}

void Encoder::encodeNode(NodeIndex n) {
    PackedNode packed = packing_.node(n);
    SplitNode node;
    node.frontier = packed.frontier;
    node.layout = forest_.layout;
    std::array<uint32_t, 3> next{packed.frontier, 0, 0};
    std::vector<NestedCriterion> frontier;
    for (const PackedSlot& slot : packed.slot) {
        const CollapseShape shape = shapes_[slot.record];
        VertexSplit split = encodeSplit(slot, shape);
        if (frontier.size() < node.frontier)
            frontier.push_back(split.criterion.at(shape.merged, forest_.grid));
        for (const int end : {0, 1}) {
            const uint32_t kind = slot.kinds >> (2 * end) & 3;
            if (kind > 0)
                split.child[size_t(end)] = uint16_t((kind - 1) * kSplitSlots + next[kind - 1]++);
        }
        node.split.push_back(split);
        if (forest_.layout.words() > 0)
            collapses_.store.readWords(slot.record, forest_.layout, node.word);
    }
    struct Parts {
        uint32_t count = 0;
        std::array<NestedCriterion, kMostParts> part;
    } parts;
    for (const NestedCriterion& part : partsOf(frontier)) {
        packed.row.criterion = parts.count == 0 ? part : packed.row.criterion.joined(part);
        parts.part[parts.count++] = part;
    }
    parts_.write(n * sizeof parts, std::as_bytes(std::span(&parts, 1)));
    for (const size_t side : {0u, 1u}) {
        const NodeIndex child = packed.row.child[side];
        if (child == kNoNode) continue;
        parts_.read(child * sizeof parts, std::as_writable_bytes(std::span(&parts, 1)));
        node.child_parts[side].assign(parts.part.begin(), parts.part.begin() + parts.count);
    }
    sink_(n, packed.row, forest_.grid, node);
}

}  // namespace

SplitForest encodeSplits(const Collapses& collapses, const Lattice& lattice, TempSpace& space,
                         BuildCounts& counts, const SplitSink& sink) {
    counts.refused = collapses.refused;
    counts.levels = collapses.largest_height;
    counts.operations = collapses.store.size();
    SplitForest forest;
    forest.lattice = lattice;
    Encoder(collapses, space, counts, sink, forest).run();
    return forest;
}

}  // namespace pietra::pmesh
