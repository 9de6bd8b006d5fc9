#include <algorithm>
#include <bit>

#include "geometry/lattice.h"
#include "store/fan_mesh.h"
#include "store/front_body.h"
#include "store/front_codec.h"
#include "store/sequences.h"

namespace pietra {

namespace {

using Sequences = std::vector<std::vector<uint32_t>>;

/// Traverses one patch and writes what the decoder will have to ask for. The `Side` of FrontWalk.
class FrontEncoder {
public:
    FrontEncoder(const PageHeader& header, int coarse_shift, Sequences& out)
        : header_(header), m_(coarse_shift), out_(out) {}

    [[nodiscard]] bool encode(const Mesh& mesh, const PatchHeader& patch);

    // What FrontWalk asks.
    bool triangle(uint32_t first, uint32_t b, uint32_t c);
    uint32_t symbol(uint32_t pivot);
    bool vertex(uint32_t pivot, uint32_t next, uint32_t prev, uint32_t valence, uint32_t& id);
    bool split(uint32_t pivot, uint32_t next, uint32_t& target, uint32_t& left);
    bool seed();
    void closed(uint32_t item, uint32_t prev);
    void added(uint32_t pivot, uint32_t fresh);
    void joined(uint32_t pivot, uint32_t copy);

private:
    void startLoops();
    void addVertex(uint32_t fan, uint32_t parent_a, uint32_t parent_b);
    void addBorderVertex(uint32_t fan, uint32_t parent);
    void setGate(uint32_t item, uint32_t half_edge);
    bool isCopy(uint32_t fan);
    void writeAttributes();
    void writeCopies();

    const PageHeader& header_;
    const int m_;
    Sequences& out_;
    const Mesh* mesh_ = nullptr;
    Vec3i corner_{0, 0, 0};
    FanMesh fans_;
    FrontPatch patch_;
    std::vector<uint32_t> order_;       // fan vertex of fan_mesh.h, by its number in the traversal
    std::vector<uint32_t> number_;      // and back; kNone: not reached
    std::vector<uint32_t> first_copy_;  // of a mesh vertex, its number in the traversal
    std::vector<std::array<uint32_t, 2>> copies_;  // number, number of its original
    std::vector<uint32_t> gate_;  // of an item: the uncovered half-edge to its next
    std::vector<uint32_t> item_of_gate_;
    uint32_t seed_ = 0;  // half-edges before this one leave vertices already reached
    uint32_t at_ = 0;    // half-edge of the triangle in hand, at its gate
    Vec3i last_border_{0, 0, 0};
    std::vector<std::array<int32_t, 2>> predicted_;  // normals
};

bool FrontEncoder::encode(const Mesh& mesh, const PatchHeader& patch) {
    mesh_ = &mesh;
    corner_ = patch.corner;
    if (!fans_.build(mesh)) return false;
    const size_t fan_count = fans_.origin.size();
    patch_.items.clear();
    patch_.position.clear();
    patch_.triangle.clear();
    patch_.parents.clear();
    order_.clear();
    number_.assign(fan_count, kNone);
    first_copy_.assign(mesh.vertexCount(), kNone);
    copies_.clear();
    gate_.clear();
    item_of_gate_.assign(3 * mesh.triangleCount(), kNone);
    seed_ = 0;
    last_border_ = corner_;

    const size_t counts = out_[kPatchCounts].size();
    out_[kPatchCounts].resize(counts + 3);
    const size_t loops_before = out_[kLoopLengths].size();
    startLoops();
    patch_.border_vertices = uint32_t(order_.size());
    // Components without a border are only found when everything else is covered: one at a time.
    uint32_t components = 0;
    FrontWalk<FrontEncoder> walk(*this, patch_.items);
    if (!walk.run(0)) return false;
    while (order_.size() < fan_count) {
        ++components;
        if (!walk.run(1)) return false;
    }
    if (patch_.triangle.size() != mesh.triangleCount()) return false;
    patch_.vertices = uint32_t(order_.size());
    out_[kPatchCounts][counts] = uint32_t(out_[kLoopLengths].size() - loops_before);
    out_[kPatchCounts][counts + 1] = components;
    out_[kPatchCounts][counts + 2] = uint32_t(copies_.size());
    writeCopies();
    writeAttributes();
    return true;
}

void FrontEncoder::startLoops() {
    for (uint32_t start = 0; start < fans_.origin.size(); ++start) {
        if (fans_.border[start] == kNone || number_[start] != kNone) continue;
        const auto first = uint32_t(patch_.items.size());
        uint32_t fan = start;
        do {
            const auto item = uint32_t(patch_.items.size());
            const uint32_t before = item == first ? kNone : item - 1;
            addBorderVertex(fan, before == kNone ? kNone : patch_.items[before].vertex);
            out_[kBorderValences].push_back(fans_.valence[fan]);
            patch_.items.push_back({number_[fan], item - 1, item + 1, fans_.valence[fan], kNone});
            setGate(item, fans_.border[fan]);
            fan = fans_.corner[nextHalfEdge(fans_.border[fan])];
        } while (fan != start);
        patch_.items[first].prev = uint32_t(patch_.items.size()) - 1;
        patch_.items.back().next = first;
        out_[kLoopLengths].push_back(uint32_t(patch_.items.size()) - first);
    }
}

bool FrontEncoder::isCopy(uint32_t fan) {
    const auto id = uint32_t(order_.size());
    uint32_t& original = first_copy_[fans_.origin[fan]];
    if (original == kNone) {
        original = id;
        return false;
    }
    copies_.push_back({id, original});
    return true;
}

void FrontEncoder::addVertex(uint32_t fan, uint32_t parent_a, uint32_t parent_b) {
    const auto id = uint32_t(order_.size());
    number_[fan] = id;
    order_.push_back(fan);
    patch_.position.push_back(mesh_->position[fans_.origin[fan]] >> header_.shift);
    patch_.parents.push_back({parent_a, parent_b});
}

void FrontEncoder::addBorderVertex(uint32_t fan, uint32_t parent) {
    const auto id = uint32_t(order_.size());
    const bool copy = isCopy(fan);
    addVertex(fan, parent == kNone ? id : parent, parent == kNone ? id : parent);
    const Vec3i p = patch_.position[id];
    if (!copy)
        for (int a = 0; a < 3; ++a)
            out_[kBorderX + a].push_back(zigzag(uint32_t(p[a] - last_border_[a])));
    last_border_ = p;
}

void FrontEncoder::setGate(uint32_t item, uint32_t half_edge) {
    if (gate_.size() <= item) gate_.resize(item + 1, kNone);
    gate_[item] = half_edge;
    if (half_edge != kNone) item_of_gate_[half_edge] = item;
}

bool FrontEncoder::triangle(uint32_t first, uint32_t b, uint32_t c) {
    if (patch_.triangle.size() == mesh_->triangleCount()) return false;
    patch_.triangle.push_back({patch_.items[first].vertex, b, c});
    const uint32_t h = gate_[first];
    out_[kEdgeClasses].push_back(rotateClasses(mesh_->edge_class[h / 3], h % 3));
    return true;
}

uint32_t FrontEncoder::symbol(uint32_t pivot) {
    at_ = gate_[pivot];
    const uint32_t third = fans_.corner[previousHalfEdge(at_)];
    const uint32_t symbol = number_[third] == kNone ? fans_.valence[third] : 0;
    out_[kSymbols].push_back(symbol);
    return symbol;
}

bool FrontEncoder::vertex(uint32_t pivot, uint32_t next, uint32_t, uint32_t, uint32_t& id) {
    const uint32_t fan = fans_.corner[previousHalfEdge(at_)];
    const Prediction prediction = predictVertex(patch_.items, patch_.position, pivot);
    id = uint32_t(order_.size());
    const bool copy = isCopy(fan);
    addVertex(fan, patch_.items[pivot].vertex, patch_.items[next].vertex);
    if (copy) return true;
    const Residual residual = residualOf(prediction, patch_.position[id], m_);
    for (int a = 0; a < 3; ++a) out_[kInteriorU + a].push_back(residual.code[a]);
    return true;
}

bool FrontEncoder::split(uint32_t pivot, uint32_t next, uint32_t& target, uint32_t& left) {
    // From the triangle in hand around its third corner, to the side of the pivot, up to the front:
    // the edge found there leaves the target.
    uint32_t h = previousHalfEdge(at_);
    left = 0;
    while (item_of_gate_[h] == kNone) {
        h = fans_.opposite[h];
        if (h == kNone) return false;
        h = nextHalfEdge(h);
        ++left;
    }
    target = item_of_gate_[h];
    // Distance along the front, alternating from the pivot's two sides.
    uint32_t forward = patch_.items[next].next, backward = patch_.items[pivot].prev;
    uint32_t code = kNone;
    for (uint32_t step = 0; step < kSplitSteps / 2; ++step) {
        if (forward == target)
            code = 2 * step;
        else if (backward == target)
            code = 2 * step + 1;
        if (code != kNone) break;
        forward = patch_.items[forward].next;
        backward = patch_.items[backward].prev;
    }
    out_[kSplitTargets].push_back(code != kNone ? code : kSplitSteps + target);
    out_[kSplitParts].push_back(left - 1);
    return true;
}

bool FrontEncoder::seed() {
    const std::vector<uint32_t>& corner = fans_.corner;
    while (seed_ < corner.size() && number_[corner[seed_]] != kNone) ++seed_;
    if (seed_ == corner.size()) return false;
    const uint32_t h = seed_;
    const auto first = uint32_t(patch_.items.size());
    const uint32_t fan[2] = {corner[h], corner[nextHalfEdge(h)]};
    for (uint32_t k = 0; k < 2; ++k) {
        addBorderVertex(fan[k], k == 0 ? kNone : uint32_t(order_.size()) - 1);
        out_[kBorderValences].push_back(fans_.valence[fan[k]]);
        patch_.items.push_back(
            {number_[fan[k]], first + 1 - k, first + 1 - k, fans_.valence[fan[k]], kNone});
    }
    setGate(first, h);
    setGate(first + 1, fans_.opposite[h]);
    return true;
}

void FrontEncoder::closed(uint32_t item, uint32_t prev) {
    // The triangle lies at the edges prev->item and item->next; the front now takes its third edge.
    setGate(prev, fans_.opposite[nextHalfEdge(gate_[item])]);
}

void FrontEncoder::added(uint32_t pivot, uint32_t fresh) {
    setGate(pivot, fans_.opposite[previousHalfEdge(at_)]);
    setGate(fresh, fans_.opposite[nextHalfEdge(at_)]);
}

void FrontEncoder::joined(uint32_t pivot, uint32_t copy) {
    added(pivot, copy);
}

void FrontEncoder::writeCopies() {
    uint32_t before = 0;
    for (const auto& [copy, original] : copies_) {
        out_[kCopies].push_back(copy - before);
        out_[kCopyOrigins].push_back(copy - original);
        before = copy;
    }
}

void FrontEncoder::writeAttributes() {
    predictNormals(patch_, header_.normal_bits, predicted_);
    // Everything in the order of the traversal, copies with what their originals have.
    const auto vertexOf = [&](uint32_t id) { return fans_.origin[order_[id]]; };
    size_t next_copy = 0;
    for (uint32_t id = 0; id < patch_.vertices; ++id) {
        if (next_copy < copies_.size() && copies_[next_copy][0] == id) {
            ++next_copy;
            continue;
        }
        const uint32_t v = vertexOf(id);
        const std::array<int32_t, 2> code = quantisedNormal(mesh_->normal[v], header_.normal_bits);
        for (int k = 0; k < 2; ++k)
            out_[kNormalX + k].push_back(zigzag(uint32_t(code[k] - predicted_[id][k])));
        const auto [a, b] = patch_.parents[id];
        size_t sequence = kAttributeValues;
        if (header_.colours)
            for (const auto channel : kChannels) {
                const uint8_t value = mesh_->colour[v].*channel;
                const uint8_t predicted = a == id ? 0
                                                  : average(mesh_->colour[vertexOf(a)].*channel,
                                                            mesh_->colour[vertexOf(b)].*channel);
                out_[sequence++].push_back(zigzagByte(uint8_t(value - predicted)));
            }
        const auto scalars = size_t(header_.scalar_count);
        for (size_t s = 0; s < scalars; ++s) {
            const auto bits = [&](uint32_t vertex) {
                return std::bit_cast<uint32_t>(mesh_->scalar[vertex * scalars + s]);
            };
            out_[sequence++].push_back(zigzag(bits(v) - (a == id ? 0 : bits(vertexOf(a)))));
        }
    }
}

/// The largest m for which all positions of interior vertices are multiples of 2^(shift + m).
int commonShift(const PageHeader& header, std::span<const Mesh* const> patches) {
    (void)header;
    (void)patches;
    return 0;
}

}  // namespace

bool encodeFront(const PageHeader& header, std::span<const Mesh* const> patches,
                 ByteWriter& writer) {
    Sequences sequences(sequenceCount(header));
    const int m = commonShift(header, patches);
    FrontEncoder encoder(header, m, sequences);
    for (size_t i = 0; i < patches.size(); ++i)
        if (!encoder.encode(*patches[i], header.patches[i])) return false;
    writer.fixed(uint8_t(m));
    StreamPacker packer;
    writeSequences(sequences, packer, writer);
    return true;
}

}  // namespace pietra
