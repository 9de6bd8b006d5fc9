#include "methods/pmesh/encoder.h"

#include <algorithm>
#include <cmath>

#include "base/check.h"
#include "methods/pmesh/node_packer.h"
#include "methods/pmesh/ring_starts.h"

namespace pietra::pmesh {
namespace {

/// Integer, rounded up.
uint32_t lengthOf(const Vec3i& v) {
    const Vec3d d(v);
    return uint32_t(std::ceil(std::sqrt(glm::dot(d, d))));
}

/// Of a triangle, the bound is one operation's, and the rounding of its corners that of others: so
/// in an error e a part is for rounding only, and the rest for the bound, both not falling with e.
/// Rounding grows as edges do, the bound as their squares. In steps: kMuch of what is below kFew,
/// kLittle of what is above.
constexpr double kMuch = 1.0 / 5, kLittle = 1.0 / 16, kFew = 32;

/// The least error that has room for both.
double errorFor(double bound, double rounding) {
    const auto least = [](double much, double little, double part) {
        return part <= much * kFew ? part / much : kFew + (part - much * kFew) / little;
    };
    return std::max(least(1 - kMuch, 1 - kLittle, bound), least(kMuch, kLittle, rounding));
}

/// Of an error in steps.
uint8_t errorCode(double error) {
    const uint64_t units = std::max<uint64_t>(uint64_t(std::ceil(error / kErrorUnit)), 1);
    return uint8_t(std::min(encodeRoundedUp<3>(units), kMaxErrorCode));
}

/// What the operations that a node refers to in a child know from above...
struct FromAbove {
    Vec3i centre;
    double rounding;   ///< how far the centre is from where it was recorded
    ChildCode before;  ///< if it is a dummy
};
/// ...and tell.
struct FromBelow {
    uint16_t level, radius;
    uint8_t error;
};

class Encoder {
public:
    Encoder(const Collapses& collapses, TempSpace& space, BuildCounts& counts, const NodeSink& sink,
            NodeForest& forest)
        : collapses_(collapses),
          packing_(space),
          shapes_(collapses.store.shapes()),
          starts_(collapses, space),
          counts_(counts),
          sink_(sink),
          forest_(forest),
          step_(double(1 << forest.lattice.shift)) {}

    void run() {
        const auto base_vertices = uint32_t(collapses_.base.vertexCount());
        packCollapses(collapses_, packing_,
                      [&](VertexId v, OperationId o) { setName(v, base_vertices + o); });
        makeBase();
        starts_.find();
        std::vector<std::vector<FromAbove>> roots;
        for (size_t v = 0; v < forest_.base_vertex.size(); ++v) {
            const OperationId o = forest_.base_operation[v];
            if (o == kNoOperation) continue;
            roots.resize(std::max<size_t>(roots.size(), nodeOf(o) + 1));
            roots[nodeOf(o)].push_back({forest_.base_vertex[v].position(), 0, kNoChildCode});
        }
        if (roots.empty()) roots.emplace_back();  // of the one node that there is at least
        for (NodeIndex n = 0; n < roots.size(); ++n) encodeNode(n, roots[n]);
    }

private:
    struct Work {
        NodeRow row;
        OperationNode node;
        std::vector<PackedSlot> slot;
        std::vector<Operation> operation;
        std::vector<FromAbove> above;  // of each slot
        std::array<std::vector<FromAbove>, 2> children;
        std::array<std::vector<FromBelow>, 2> below;
        std::array<NodeRow, 2> child;
    };
    /// What a node leaves to its parent.
    struct Encoded {
        NodeRow row;
        std::vector<FromBelow> told;
    };

    void setName(VertexId vertex, uint32_t name) {
        starts_.addName(vertex, name);
        if (!counts_.name_of.empty()) counts_.name_of[vertex] = name;
    }
    void makeBase();
    Encoded encodeNode(NodeIndex n, std::span<const FromAbove> frontier);
    void refine(Work& work);
    Operation encodeOperation(uint32_t record, const CollapseShape& r, const FromAbove& above);
    void setRanks(Operation& o, uint32_t record, const CollapseShape& r);
    void setOffsets(Operation& o, const CollapseShape& r, const Vec3i& from, uint32_t kinds) const;
    static void saturate(Work& work);
    static void bound(Work& work);

    const Collapses& collapses_;
    Packing packing_;
    CachedRecords<CollapseShape> shapes_;
    RingStarts starts_;
    BuildCounts& counts_;
    const NodeSink& sink_;
    NodeForest& forest_;
    double step_;
};

void Encoder::makeBase() {
    const Mesh& base = collapses_.base;
    forest_.layout = WordLayout::of(base);
    forest_.base_triangle = base.triangle;
    forest_.base_closed = collapses_.base_closed;
    forest_.base_operation = packing_.base_operation;
    for (uint32_t v = 0; v < base.vertexCount(); ++v) {
        const Vec3i p = base.position[v] >> forest_.lattice.shift;
        forest_.base_vertex.push_back({p.x, p.y, p.z, packNormal(base.normal[v])});
        appendWords(base, v, forest_.layout, forest_.base_word);
        setName(collapses_.base_vertex[v], v);
    }
}

Encoder::Encoded Encoder::encodeNode(NodeIndex n, std::span<const FromAbove> frontier) {
    Work work;
    {
        PackedNode packed = packing_.node(n);
        work.row = packed.row;
        work.slot = std::move(packed.slot);
    }
    work.above.assign(frontier.begin(), frontier.end());
    work.node.frontier = uint32_t(frontier.size());
    refine(work);
    for (const size_t side : {0u, 1u}) {
        const NodeIndex child = work.row.child[side];
        if (child == kNoNode) continue;
        Encoded encoded = encodeNode(child, work.children[side]);
        work.child[side] = encoded.row;
        work.below[side] = std::move(encoded.told);
        for (const FromBelow& b : work.below[side])
            work.node.reference_level[side].push_back(b.level);
    }
    saturate(work);
    bound(work);
    std::vector<FromBelow> told;
    for (uint32_t s = 0; s < work.node.frontier; ++s) {
        const NodeOperation& o = work.node.operation[s];
        told.push_back({uint16_t(o.structure.level()), o.radius, o.error});
    }
    sink_(n, work.row, work.node);
    return {work.row, std::move(told)};
}

/// From slot to slot, as the decoder will.
void Encoder::refine(Work& work) {
    std::array<uint32_t, 3> next{work.node.frontier, 0, 0};
    work.node.layout = forest_.layout;
    for (uint32_t s = 0; s < work.slot.size(); ++s) {
        const uint32_t record = work.slot[s].record;
        const CollapseShape r = shapes_[record];
        const FromAbove above = work.above[s];
        Operation o = encodeOperation(record, r, above);
        if (!o.isDummy()) setOffsets(o, r, above.centre, work.slot[s].kinds);
        std::array<ChildCode, 2> code{kNoChildCode, o.isDummy() ? above.before : kNoChildCode};
        for (const int end : {0, 1}) {
            const uint32_t kind = work.slot[s].kinds >> (2 * end) & 3;
            if (kind == 0) continue;
            code[size_t(end)] = (kind - 1) * kNodeSlots + next[kind - 1]++;
            const Vec3i centre = above.centre + o.offset(end);
            const double rounding = glm::distance(Vec3d(centre), Vec3d(r.position[size_t(end)]));
            if (kind == 1)
                work.above.push_back({centre, rounding, s});
            else
                work.children[kind - 2].push_back({centre, rounding, kNodeSlots + s});
        }
        work.operation.push_back(o);
        NodeOperation packed;
        packed.structure = StructureWord::of(code[0], code[1], o.level);
        packed.ranks = o.ranks;
        packed.delta = o.delta;
        packed.normals = o.normals;
        packed.normal = o.normal;
        packed.shift = o.shift;
        work.node.operation.push_back(packed);
        if (forest_.layout.words() > 0)
            collapses_.store.readWords(record, forest_.layout, work.node.word);
    }
}

Operation Encoder::encodeOperation(uint32_t record, const CollapseShape& r,
                                   const FromAbove& above) {
    Operation o{};
    o.level = uint16_t(collapses_.largest_height - r.height);
    o.normal = r.normal;
    o.normals = r.normals;
    o.radius = uint16_t(encodeRoundedUp<11>(r.radius));
    o.error = errorCode(errorFor(double(r.error) / step_, above.rounding));
    if (r.ring_size > 0) {
        setRanks(o, record, r);
        return o;
    }
    // A dummy: to where the vertex is to be, as far as sixteen bits reach.
    o.ranks = Operation::kDummyRanks;
    const Vec3i offset = glm::clamp(r.position[0] - above.centre, -32768, 32767);
    for (int k = 0; k < 3; ++k) {
        o.delta[0][size_t(k)] = int8_t(offset[k] >> 8);
        o.delta[1][size_t(k)] = int8_t(offset[k] & 0xff);
    }
    o.radius = uint16_t(encodeRoundedUp<11>(lengthOf(offset)));
    return o;
}

void Encoder::setRanks(Operation& o, uint32_t record, const CollapseShape& r) {
    const uint32_t least = r.closed ? starts_.of(record) : 0;
    const auto rank = [&](uint32_t place) {
        return place == kNoRank ? kNoRank : (place + r.ring_size - least) % r.ring_size;
    };
    o.ranks = uint8_t(rank(r.left) | rank(r.right) << 4);
}

void Encoder::setOffsets(Operation& o, const CollapseShape& r, const Vec3i& from,
                         uint32_t kinds) const {
    const std::array<Vec3i, 2> offset{r.position[0] - from, r.position[1] - from};
    const QuantisedOffsets q = quantiseOffsets(offset);
    o.shift = q.shift;
    o.delta = q.delta;
    for (const int end : {0, 1}) {
        if ((kinds >> (2 * end) & 3) != 0) continue;  // an operation below puts it right
        const Vec3i rest = glm::abs(o.offset(end) - offset[size_t(end)]);
        const uint32_t largest = uint32_t(std::max({rest.x, rest.y, rest.z}));
        counts_.inexact_ends += largest != 0;
        counts_.largest_error = std::max(counts_.largest_error, largest);
    }
}

/// From the last slot up: no operation states less than those below it.
void Encoder::saturate(Work& work) {
    for (size_t s = work.slot.size(); s-- > 0;) {
        Operation& o = work.operation[s];
        uint32_t radius = decodeRadius(o.radius);
        for (const int end : {0, 1}) {
            const uint32_t kind = work.slot[s].kinds >> (2 * end) & 3;
            const uint32_t slot = work.node.operation[s].structure.child(end) % kNodeSlots;
            if (!o.isDummy() || kind != 0) radius = std::max(radius, lengthOf(o.offset(end)));
            if (kind == 0) continue;
            const auto enclose = [&](uint16_t below, uint8_t error) {
                o.error = std::max(o.error, error);
                radius = std::max(radius, lengthOf(o.offset(end)) + decodeRadius(below));
            };
            if (kind == 1)
                enclose(work.operation[slot].radius, work.operation[slot].error);
            else
                enclose(work.below[kind - 2][slot].radius, work.below[kind - 2][slot].error);
        }
        const uint32_t code = encodeRoundedUp<11>(radius);
        CHECK_LE(code, kMaxRadiusCode);
        work.node.operation[s].radius = o.radius = uint16_t(code);
        work.node.operation[s].error = o.error;
    }
}

/// The sphere around those of the operations referred to from above, which enclose all below, and
/// around the children's, whose rounding may stick out.
void Encoder::bound(Work& work) {
    NodeRow& row = work.row;
    Box3i box;
    for (uint32_t s = 0; s < work.node.frontier; ++s) box.add(work.above[s].centre);
    if (box.empty()) return;
    row.centre = (box.min + box.max) >> 1;
    uint32_t radius = 0;
    const auto enclose = [&](const Vec3i& centre, uint16_t code, uint8_t error) {
        radius = std::max(radius, lengthOf(centre - row.centre) + decodeRadius(code));
        row.error = std::max(row.error, error);
    };
    for (uint32_t s = 0; s < work.node.frontier; ++s)
        enclose(work.above[s].centre, work.operation[s].radius, work.operation[s].error);
    for (const size_t side : {0u, 1u})
        if (row.child[side] != kNoNode)
            enclose(work.child[side].centre, work.child[side].radius, work.child[side].error);
    row.radius = uint16_t(encodeRoundedUp<11>(radius));
}

}  // namespace

NodeForest encode(const Collapses& collapses, const Lattice& lattice, TempSpace& space,
                  BuildCounts& counts, const NodeSink& sink) {
    counts.refused = collapses.refused;
    counts.levels = collapses.largest_height;
    counts.dummies = collapses.dummies;
    counts.operations = collapses.store.size();
    NodeForest forest;
    forest.lattice = lattice;
    Encoder(collapses, space, counts, sink, forest).run();
    return forest;
}

}  // namespace pietra::pmesh
