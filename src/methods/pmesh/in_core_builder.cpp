#include "methods/pmesh/in_core_builder.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "base/check.h"
#include "methods/pmesh/active_mesh.h"
#include "methods/pmesh/node_packer.h"
#include "simplify/simplify.h"

namespace pietra::pmesh {
namespace {

/// Non-manifold edges and those of triangles that disagree on their orientation are of class kMany:
/// the simplifier locks their ends.
void setEdgeClasses(Mesh& mesh, const HalfEdges& edges) {
    mesh.edge_class.assign(mesh.triangleCount(), 0);
    for (uint32_t slot = 0; slot < edges.twin.size(); ++slot) {
        const EdgeClass c = edges.twin[slot] != kNoCorner ? EdgeClass::kManifold
                            : edges.uses[slot] == 1       ? EdgeClass::kBorder
                                                          : EdgeClass::kMany;
        mesh.edge_class[slot / 3] |= uint8_t(uint32_t(c) << (2 * (slot % 3)));
    }
}

SimplifyOutput collapseAll(const Mesh& mesh, int shift, Recorder& recorder) {
    const std::vector<uint8_t> cell(mesh.triangleCount(), 0);
    const std::vector<uint32_t> quota{0};
    SimplifyInput input;
    input.mesh = &mesh;
    input.cell = cell;
    input.quota = quota;
    input.shift = shift;
    input.sink = &recorder;
    Simplifier simplifier;
    SimplifyOutput output;
    simplifier.run(input, output);
    return output;
}

/// Integer, rounded up.
uint32_t lengthOf(const Vec3i& v) {
    const Vec3d d(v);
    return uint32_t(std::ceil(std::sqrt(glm::dot(d, d))));
}

/// Of an error in steps.
uint8_t errorCode(double error) {
    const uint64_t units = std::max<uint64_t>(uint64_t(std::ceil(error / kErrorUnit)), 1);
    return uint8_t(std::min(encodeRoundedUp<3>(units), kMaxErrorCode));
}

class Encoder {
public:
    Encoder(const Recorder& recorder, const SimplifyOutput& base, const Lattice& lattice,
            size_t input_vertices, ProgressiveMesh& mesh, BuildCounts& counts)
        : recorder_(recorder),
          base_(base),
          shift_(lattice.shift),
          slot_of_(input_vertices, kNoVertex),
          mesh_(mesh),
          counts_(counts) {
        mesh_.lattice = lattice;
    }

    std::vector<NodeRow> run() {
        makeBase();
        orderOperations();
        Packing packing = pack();
        listOperations(packing.id_of);
        encodeStars();
        saturate();
        return std::move(packing.row);
    }

private:
    void makeBase();
    void orderOperations();
    Packing pack();
    void listOperations(std::span<const OperationId> id_of);
    void encodeStars();
    void encode(ActiveMesh& active, OperationId id, const CollapseRecord& r);
    void encodeDummy(ActiveMesh& active, OperationId id, const CollapseRecord& r);
    void setOffsets(Operation& o, const CollapseRecord& r, const Vec3i& from);
    void saturate();

    const Recorder& recorder_;
    const SimplifyOutput& base_;
    int shift_;
    std::vector<uint32_t> order_;     // operations' records
    std::vector<uint32_t> place_of_;  // the inverse
    std::vector<OperationId> id_;     // one an operation, in that order
    std::vector<uint32_t> slot_of_;   // input vertices in the active mesh
    ProgressiveMesh& mesh_;
    BuildCounts& counts_;
};

void Encoder::makeBase() {
    const Mesh& base = base_.mesh;
    mesh_.base_vertex.resize(base.vertexCount());
    mesh_.base_triangle = base.triangle;
    for (const CollapseRecord& r : recorder_.records())
        if (r.u != kNoVertex) slot_of_[r.u] = 0;  // gone
    for (uint32_t v = 0; v < slot_of_.size(); ++v) {
        const uint32_t slot = slot_of_[v] == 0 ? kNoVertex : base_.vertex_map[v];
        slot_of_[v] = slot;
        if (slot == kNoVertex) continue;
        const Vec3i p = base.position[slot] >> shift_;
        mesh_.base_vertex[slot] = {p.x, p.y, p.z, packNormal(recorder_.normalOf(v))};
    }
}

/// Coarse to fine; within a level the last to collapse first.
void Encoder::orderOperations() {
    const std::vector<CollapseRecord>& records = recorder_.records();
    order_.resize(records.size());
    std::iota(order_.rbegin(), order_.rend(), 0u);
    std::stable_sort(order_.begin(), order_.end(),
                     [&](uint32_t a, uint32_t b) { return records[a].height > records[b].height; });
}

Packing Encoder::pack() {
    const std::vector<CollapseRecord>& records = recorder_.records();
    place_of_.resize(records.size());
    for (uint32_t i = 0; i < order_.size(); ++i) place_of_[order_[i]] = i;
    const auto placeOf = [&](uint32_t r) { return r == kNoOperation ? r : place_of_[r]; };
    std::vector<PackOperation> operations(records.size());
    for (uint32_t i = 0; i < order_.size(); ++i) {
        const CollapseRecord& r = records[order_[i]];
        operations[i] = {{placeOf(r.child[0]), placeOf(r.child[1])}, r.deviation, {}};
        operations[i].box.add(r.position[0]);
        if (r.u != kNoVertex) operations[i].box.add(r.position[1]);
    }
    std::vector<uint32_t> roots;
    for (uint32_t v = 0; v < slot_of_.size(); ++v)
        if (slot_of_[v] != kNoVertex && recorder_.lastOf(v) != kNoOperation)
            roots.push_back(placeOf(recorder_.lastOf(v)));
    return packOperations(operations, roots);
}

/// What is known of them without their stars.
void Encoder::listOperations(std::span<const OperationId> id_of) {
    const std::vector<CollapseRecord>& records = recorder_.records();
    id_.assign(id_of.begin(), id_of.end());
    const auto idOf = [&](uint32_t r) { return r == kNoOperation ? r : id_of[place_of_[r]]; };
    const OperationId last = id_.empty() ? 0 : *std::max_element(id_.begin(), id_.end()) + 1;
    Operation none{};
    none.child = {kNoOperation, kNoOperation};
    mesh_.operation.assign(last, none);
    for (uint32_t i = 0; i < order_.size(); ++i) {
        const CollapseRecord& r = records[order_[i]];
        Operation& o = mesh_.operation[id_[i]];
        o.child = {idOf(r.child[0]), idOf(r.child[1])};
        o.level = uint16_t(recorder_.largestHeight() - r.height);
        o.normal = r.normal;
        o.ranks = r.u == kNoVertex ? Operation::kDummyRanks : uint8_t(0);
    }
    for (const OperationId id : id_)
        for (const int end : {0, 1}) {
            const OperationId child = mesh_.operation[id].childOf(end);
            if (child != kNoOperation && mesh_.operation[child].isDummy())
                mesh_.operation[child].child[1] = id;
        }
    mesh_.base_operation.assign(mesh_.base_vertex.size(), kNoOperation);
    for (uint32_t v = 0; v < slot_of_.size(); ++v)
        if (slot_of_[v] != kNoVertex) mesh_.base_operation[slot_of_[v]] = idOf(recorder_.lastOf(v));
}

void Encoder::encodeStars() {
    ActiveMesh active(mesh_);
    const size_t count = order_.size();
    active.resize(active.vertexCount() + count, active.faceCount() + 2 * count);
    active.resize(mesh_.base_vertex.size(), mesh_.base_triangle.size());
    for (size_t i = 0; i < count; ++i) {
        const OperationId id = id_[i];
        const CollapseRecord& r = recorder_.records()[order_[i]];
        CHECK_EQ(active.record[slot_of_[r.v]].next, id);
        if (r.u == kNoVertex) {
            encodeDummy(active, id, r);
        } else {
            encode(active, id, r);
        }
    }
    counts_.name_of = slot_of_;
    for (uint32_t& name : counts_.name_of)
        if (name != kNoVertex) name = active.pulse[name].name;
}

/// Moves v to where it is to be, as far as sixteen bits reach.
void Encoder::encodeDummy(ActiveMesh& active, OperationId id, const CollapseRecord& r) {
    Operation& o = mesh_.operation[id];
    const uint32_t v = slot_of_[r.v];
    const Vec3i offset = glm::clamp(r.position[0] - active.vertex[v].position(), -32768, 32767);
    o.shift = 0;
    for (int k = 0; k < 3; ++k) {
        o.delta[0][size_t(k)] = int8_t(offset[k] >> 8);
        o.delta[1][size_t(k)] = int8_t(offset[k] & 0xff);
    }
    o.radius = uint16_t(encodeRoundedUp<11>(lengthOf(offset)));
    o.error = errorCode(lengthOf(offset));
    Star star;
    active.gatherStars({&v, 1}, &star, [](uint32_t) {});
    active.move(v, star);
}

void Encoder::encode(ActiveMesh& active, OperationId id, const CollapseRecord& r) {
    Operation& o = mesh_.operation[id];
    const uint32_t v = slot_of_[r.v], u = uint32_t(active.vertexCount());
    Star star;
    active.gatherStars(std::span(&v, 1), &star, [](uint32_t) {});
    CHECK(active.orient(star));
    uint32_t left = kNoRank, right = kNoRank, radius = 0;
    const Vec3i from = active.vertex[v].position();
    for (uint32_t rank = 0; rank < star.neighbours(); ++rank) {
        const uint32_t w = star.neighbour[star.placeOf(rank)];
        if (r.left != kNoVertex && w == slot_of_[r.left]) left = rank;
        if (r.right != kNoVertex && w == slot_of_[r.right]) right = rank;
        radius = std::max(radius, lengthOf(active.vertex[w].position() - from));
    }
    CHECK_EQ(left == kNoRank, r.left == kNoVertex);
    CHECK_EQ(right == kNoRank, r.right == kNoVertex);
    o.ranks = uint8_t(left | right << 4);
    setOffsets(o, r, from);
    radius = std::max({radius, lengthOf(o.offset(0)), lengthOf(o.offset(1))});
    o.radius = uint16_t(encodeRoundedUp<11>(radius));
    o.error = errorCode(double(r.deviation) / double(1 << shift_));
    const uint32_t face = uint32_t(active.faceCount());
    active.resize(u + 1, face + (left != kNoRank) + (right != kNoRank));
    active.split(v, star, u, {face, face + 1});
    slot_of_[r.u] = u;
}

void Encoder::setOffsets(Operation& o, const CollapseRecord& r, const Vec3i& from) {
    const std::array<Vec3i, 2> offset{r.position[0] - from, r.position[1] - from};
    const QuantisedOffsets q = quantiseOffsets(offset);
    o.shift = q.shift;
    o.delta = q.delta;
    for (const int end : {0, 1}) {
        if (r.child[size_t(end)] != kNoOperation) continue;  // which puts it right
        const Vec3i rest = glm::abs(o.offset(end) - offset[size_t(end)]);
        const uint32_t largest = uint32_t(std::max({rest.x, rest.y, rest.z}));
        counts_.inexact_ends += largest != 0;
        counts_.largest_error = std::max(counts_.largest_error, largest);
    }
}

/// From the fine side up: no operation states less than those below it.
void Encoder::saturate() {
    for (size_t i = mesh_.operation.size(); i-- > 0;) {
        Operation& o = mesh_.operation[i];
        if (o.error == 0) continue;
        uint32_t radius = decodeRadius(o.radius);
        for (const int end : {0, 1}) {
            if (o.childOf(end) == kNoOperation) continue;
            const Operation& child = mesh_.operation[o.childOf(end)];
            o.error = std::max(o.error, child.error);
            radius = std::max(radius, lengthOf(o.offset(end)) + decodeRadius(child.radius));
        }
        const uint32_t code = encodeRoundedUp<11>(radius);
        CHECK_LE(code, kMaxRadiusCode);
        o.radius = uint16_t(code);
    }
}

}  // namespace

ProgressiveMesh buildInCore(Mesh mesh, const Lattice& lattice, Budget& budget,
                            BuildCounts* counts) {
    const Reservation memory =
        budget.reserve(kBuildBytes * mesh.triangleCount(), "a progressive mesh, built in memory,");
    BuildCounts unused;
    BuildCounts& c = counts ? *counts : unused;
    ProgressiveMesh result;
    std::vector<uint8_t> irregular;
    {
        HalfEdges edges = findHalfEdges(mesh.triangle, mesh.vertexCount());
        setEdgeClasses(mesh, edges);
        irregular = std::move(edges.irregular);
    }
    c.irregular_vertices = uint64_t(std::count(irregular.begin(), irregular.end(), 1));
    Recorder recorder(mesh, irregular, lattice.shift);
    const SimplifyOutput base = collapseAll(mesh, lattice.shift, recorder);
    c.refused = recorder.refused();
    c.levels = recorder.largestHeight();
    c.dummies = recorder.dummies();
    c.row = Encoder(recorder, base, lattice, mesh.vertexCount(), result, c).run();
    c.operations = recorder.records().size();
    return result;
}

}  // namespace pietra::pmesh
