#include "methods/pmesh/split_encoder.h"

#include <algorithm>
#include <cmath>

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

class Encoder {
public:
    Encoder(const Collapses& collapses, TempSpace& space, BuildCounts& counts,
            const SplitSink& sink, SplitForest& forest)
        : collapses_(collapses),
          packing_(space),
          shapes_(collapses.store.shapes()),
          wings_(collapses.store.wings()),
          wing_leaves_(collapses, space),
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
        std::vector<NestedCriterion> row(packing_.size());
        for (NodeIndex n = packing_.size(); n-- > 0;) encodeNode(n, row);
    }

private:
    void makeBase();
    void encodeNode(NodeIndex n, std::vector<NestedCriterion>& rows);
    VertexSplit encodeSplit(const PackedSlot& slot, const CollapseShape& r);
    NestedCriterion criterionOf(const CollapseShape& r) const;

    const Collapses& collapses_;
    Packing packing_;
    CachedRecords<CollapseShape> shapes_;
    CachedRecords<Wings> wings_;
    WingLeaves wing_leaves_;
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
    split.criterion = criterionOf(r);
    return split;
}

void Encoder::encodeNode(NodeIndex n, std::vector<NestedCriterion>& rows) {
    PackedNode packed = packing_.node(n);
    SplitNode node;
    node.frontier = packed.frontier;
    node.layout = forest_.layout;
    std::array<uint32_t, 3> next{packed.frontier, 0, 0};
    for (const PackedSlot& slot : packed.slot) {
        VertexSplit split = encodeSplit(slot, shapes_[slot.record]);
        for (const int end : {0, 1}) {
            const uint32_t kind = slot.kinds >> (2 * end) & 3;
            if (kind > 0)
                split.child[size_t(end)] = uint16_t((kind - 1) * kSplitSlots + next[kind - 1]++);
        }
        node.split.push_back(split);
        if (forest_.layout.words() > 0)
            collapses_.store.readWords(slot.record, forest_.layout, node.word);
    }
    NestedCriterion& row = rows[n];
    for (uint32_t s = 0; s < node.frontier; ++s)
        row = s == 0 ? node.split[s].criterion : row.joined(node.split[s].criterion);
    packed.row.criterion = row;
    for (const size_t side : {0u, 1u})
        if (const NodeIndex child = packed.row.child[side]; child != kNoNode)
            node.child_criterion[side] = rows[child];
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
