#include <algorithm>
#include <bit>
#include <cstring>

#include "base/hash.h"
#include "geometry/lattice.h"
#include "store/fan_mesh.h"
#include "store/front_body.h"
#include "store/front_codec.h"
#include "store/sequences.h"

namespace pietra {

namespace {

using Sequences = std::vector<std::vector<uint32_t>>;

/// Finds the border vertices of a page by position: the last one appended.
class SharedIndex {
public:
    void reset(size_t most) {
        slots_.assign(std::bit_ceil(2 * most + 1), kNone);
        list_.clear();
    }
    std::vector<SharedVertex>& list() { return list_; }
    /// Makes the list's vertices from `begin` on known.
    void add(size_t begin) {
        for (size_t i = begin; i < list_.size(); ++i) slots_[slotOf(list_[i].at)] = uint32_t(i);
    }
    uint32_t find(Lanes at) const { return slots_[slotOf(at)]; }
    const SharedVertex& operator[](uint32_t i) const { return list_[i]; }
    uint32_t size() const { return uint32_t(list_.size()); }

private:
    static uint64_t keyOf(Lanes at) { return latticeKey(toVec3i(at)); }
    size_t slotOf(Lanes at) const {
        const uint64_t key = keyOf(at);
        size_t slot = mixBits(key) & (slots_.size() - 1);
        while (slots_[slot] != kNone && keyOf(list_[slots_[slot]].at) != key)
            slot = (slot + 1) & (slots_.size() - 1);
        return slot;
    }
    std::vector<SharedVertex> list_;
    std::vector<uint32_t> slots_;
};

/// Where a patch's vertices and triangles end up.
struct PatchOrder {
    std::vector<uint32_t> vertex;        // the mesh's vertex, by its place in the decoded patch
    std::vector<uint32_t> first_corner;  // half-edge of the mesh (fan_mesh.h), by decoded triangle
};

/// Traverses the patches of a page and writes what the decoder will have to ask for. The `Side` of
/// FrontWalk.
class FrontEncoder {
public:
    FrontEncoder(const PageHeader& header, std::span<const Mesh* const> patches, int coarse_shift,
                 Sequences& out)
        : header_(header), patches_(patches), coder_(coarse_shift), out_(out) {
        size_t vertices = 0;
        for (const Mesh* mesh : patches) vertices += mesh->vertexCount();
        shared_.reset(vertices);
    }

    /// Patches in their order; false where a patch cannot be written.
    [[nodiscard]] bool encode(uint32_t patch, const FanMesh& fans, PatchOrder& order);

    // What FrontWalk asks.
    bool triangle(uint32_t first, uint32_t b, uint32_t c);
    uint32_t symbol(uint32_t pivot);
    bool vertex(uint32_t pivot, uint32_t& id, Lanes& at);
    bool split(uint32_t pivot, uint32_t& target, uint32_t& left);
    bool seed();
    void closed(uint32_t item, uint32_t prev);
    void added(uint32_t pivot, uint32_t fresh);

private:
    void startLoops();
    Lanes positionOf(uint32_t fan) const {
        return toLanes(mesh_->position[fans_->origin[fan]] >> header_.shift);
    }
    uint32_t addVertex(uint32_t fan, Lanes at, uint32_t parent_a, uint32_t parent_b);
    uint32_t addBorderVertex(uint32_t fan, uint32_t parent, bool may_share);
    uint32_t findShared(uint32_t vertex, Lanes at);
    bool sameAttributes(uint32_t vertex, const SharedVertex& other) const;
    void setGate(uint32_t item, uint32_t half_edge);
    bool isCopy(uint32_t fan);
    uint32_t vertexOf(uint32_t id) const { return fans_->origin[reached_[id]]; }
    void writeCopies();
    void writeNormals();
    void writeValues();
    void finishOrder(uint32_t patch);

    const PageHeader& header_;
    const std::span<const Mesh* const> patches_;
    const ResidualCoder coder_;
    Sequences& out_;
    SharedIndex shared_;

    // Of the patch in hand:
    const Mesh* mesh_ = nullptr;
    const FanMesh* fans_ = nullptr;
    PatchOrder* order_ = nullptr;
    FrontPatch patch_;
    std::vector<uint32_t> reached_;     // fan vertex of fan_mesh.h, by its number in the traversal
    std::vector<uint32_t> number_;      // and back; kNone: not reached
    std::vector<uint32_t> first_copy_;  // of a mesh vertex, its number in the traversal
    std::vector<std::array<uint32_t, 2>> copies_;  // number, number of its original
    std::vector<uint32_t> gate_;  // of an item: the uncovered half-edge to its next
    std::vector<uint32_t> item_of_gate_;
    uint32_t seed_ = 0;  // half-edges before this one leave vertices already reached
    uint32_t at_ = 0;    // half-edge of the triangle in hand, at its gate
    Vec3i last_border_{0, 0, 0};
    uint32_t expected_ = kNone;  // place of the shared vertex wanted next
    NormalPredictor normals_;
};

bool FrontEncoder::encode(uint32_t patch, const FanMesh& fans, PatchOrder& order) {
    mesh_ = patches_[patch];
    fans_ = &fans;
    order_ = &order;
    const size_t fan_count = fans.origin.size();
    patch_.reset(fan_count, mesh_->triangleCount());
    reached_.clear();
    number_.assign(fan_count, kNone);
    first_copy_.assign(mesh_->vertexCount(), kNone);
    copies_.clear();
    gate_.clear();
    item_of_gate_.assign(fans.opposite.size(), kNone);
    seed_ = 0;
    last_border_ = header_.patches[patch].corner;
    expected_ = kNone;
    order.first_corner.clear();

    startLoops();
    // Components without a border are only found when everything else is covered: one at a time.
    uint32_t components = 0;
    FrontWalk<FrontEncoder> walk(*this, patch_.items);
    if (!walk.run(0)) return false;
    for (; reached_.size() < fan_count; ++components)
        if (!walk.run(1)) return false;
    if (patch_.triangles != mesh_->triangleCount()) return false;
    for (const size_t count : {patch_.loop_begin.size(), size_t(components), copies_.size()})
        out_[kPatchCounts].push_back(uint32_t(count));
    writeCopies();
    writeNormals();
    writeValues();
    finishOrder(patch);
    return true;
}

void FrontEncoder::startLoops() {
    for (uint32_t start = 0; start < fans_->origin.size(); ++start) {
        if (fans_->border[start] == kNone || number_[start] != kNone) continue;
        const uint32_t first = patch_.items.size();
        patch_.loop_begin.push_back(first);
        uint32_t fan = start, id = kNone;
        do {
            id = addBorderVertex(fan, id, true);
            const uint32_t item = patch_.items.push(
                {patch_.position[id], Lanes{}, id, kNone, kNone, fans_->valence[fan]});
            setGate(item, fans_->border[fan]);
            fan = fans_->corner[nextHalfEdge(fans_->border[fan])];
        } while (fan != start);
        patch_.closeLoop(first);
        out_[kLoopLengths].push_back(patch_.items.size() - first);
    }
    patch_.border_vertices = patch_.vertices;
}

bool FrontEncoder::isCopy(uint32_t fan) {
    uint32_t& original = first_copy_[fans_->origin[fan]];
    const bool copy = original != kNone;
    if (copy)
        copies_.push_back({patch_.vertices, original});
    else
        original = patch_.vertices;
    return copy;
}

uint32_t FrontEncoder::addVertex(uint32_t fan, Lanes at, uint32_t parent_a, uint32_t parent_b) {
    number_[fan] = patch_.vertices;
    reached_.push_back(fan);
    return patch_.addVertex(at, parent_a, parent_b);
}

uint32_t FrontEncoder::addBorderVertex(uint32_t fan, uint32_t parent, bool may_share) {
    out_[kBorderValences].push_back(fans_->valence[fan]);
    const Lanes at = positionOf(fan);
    const bool copy = isCopy(fan);
    uint32_t shared = kNone;
    if (!copy && may_share) {
        shared = findShared(fans_->origin[fan], at);
        out_[kShared].push_back(shared == kNone ? kSharedNot
                                : shared == expected_
                                    ? kSharedAsExpected
                                    : kSharedByDistance + shared_.size() - 1 - shared);
        if (shared != kNone) expected_ = shared_[shared].before;
    }
    if (may_share) patch_.shared.push_back(shared);
    const Vec3i p = toVec3i(at);
    if (!copy && shared == kNone)
        for (int a = 0; a < 3; ++a)
            out_[kBorderX + a].push_back(zigzag(uint32_t(p[a] - last_border_[a])));
    last_border_ = p;
    if (parent == kNone) parent = patch_.vertices;
    return addVertex(fan, at, parent, parent);
}

/// The place of a shared vertex that carries the same, the expected one if possible.
uint32_t FrontEncoder::findShared(uint32_t vertex, Lanes at) {
    const auto same = [&](uint32_t i) {
        const Lanes other = shared_[i].at;
        return other[0] == at[0] && other[1] == at[1] && other[2] == at[2] &&
               sameAttributes(vertex, shared_[i]);
    };
    if (expected_ != kNone && same(expected_)) return expected_;
    const uint32_t found = shared_.find(at);
    return found != kNone && same(found) ? found : kNone;
}

bool FrontEncoder::sameAttributes(uint32_t vertex, const SharedVertex& other) const {
    const Mesh& mesh = *patches_[other.patch];
    const auto scalars = size_t(header_.scalar_count);
    if (quantisedNormal(mesh_->normal[vertex], header_.normal_bits) !=
        quantisedNormal(mesh.normal[other.vertex], header_.normal_bits))
        return false;
    if (header_.colours && mesh_->colour[vertex] != mesh.colour[other.vertex]) return false;
    return scalars == 0 ||
           std::memcmp(&mesh_->scalar[vertex * scalars], &mesh.scalar[other.vertex * scalars],
                       scalars * sizeof(float)) == 0;
}

void FrontEncoder::setGate(uint32_t item, uint32_t half_edge) {
    if (gate_.size() <= item) gate_.resize(item + 1, kNone);
    gate_[item] = half_edge;
    if (half_edge != kNone) item_of_gate_[half_edge] = item;
}

bool FrontEncoder::triangle(uint32_t first, uint32_t b, uint32_t c) {
    if (patch_.triangles == patch_.triangle.size()) return false;
    patch_.triangle[patch_.triangles++] = {patch_.items[first].vertex, b, c};
    order_->first_corner.push_back(gate_[first]);
    return true;
}

uint32_t FrontEncoder::symbol(uint32_t pivot) {
    at_ = gate_[pivot];
    const uint32_t third = fans_->corner[previousHalfEdge(at_)];
    const uint32_t symbol = number_[third] == kNone ? fans_->valence[third] : 0;
    out_[kSymbols].push_back(symbol);
    return symbol;
}

bool FrontEncoder::vertex(uint32_t pivot, uint32_t& id, Lanes& at) {
    const uint32_t fan = fans_->corner[previousHalfEdge(at_)];
    const FrontItem& v = patch_.items[pivot];
    at = positionOf(fan);
    if (!isCopy(fan)) {
        const auto codes = coder_.encode(Prediction(patch_.items, pivot), at);
        for (int a = 0; a < 3; ++a) out_[kInteriorU + a].push_back(codes[a]);
    }
    id = addVertex(fan, at, v.vertex, patch_.items[v.next].vertex);
    return true;
}

bool FrontEncoder::split(uint32_t pivot, uint32_t& target, uint32_t& left) {
    // From the triangle in hand around its third corner, to the side of the pivot, up to the front:
    // the edge found there leaves the target.
    uint32_t h = previousHalfEdge(at_);
    for (left = 0; item_of_gate_[h] == kNone; ++left) {
        h = fans_->opposite[h];
        if (h == kNone) return false;
        h = nextHalfEdge(h);
    }
    target = item_of_gate_[h];
    const FrontItems& items = patch_.items;
    uint32_t forward = items[items[pivot].next].next, backward = items[pivot].prev;
    uint32_t code = kSplitSteps + target;
    for (uint32_t step = 0; step < kSplitSteps / 2; ++step) {
        if (forward == target)
            code = 2 * step;
        else if (backward == target)
            code = 2 * step + 1;
        if (code < kSplitSteps) break;
        forward = items[forward].next;
        backward = items[backward].prev;
    }
    out_[kSplitTargets].push_back(code);
    out_[kSplitParts].push_back(left - 1);
    return true;
}

bool FrontEncoder::seed() {
    const std::vector<uint32_t>& corner = fans_->corner;
    const auto reached = [&](uint32_t h) {
        return corner[h] == kNone || number_[corner[h]] != kNone;
    };
    while (seed_ < corner.size() && reached(seed_)) ++seed_;
    if (seed_ == corner.size()) return false;
    const uint32_t h = seed_, first = patch_.items.size();
    uint32_t id = kNone;
    for (const uint32_t fan : {corner[h], corner[nextHalfEdge(h)]}) {
        id = addBorderVertex(fan, id, false);
        patch_.items.push({patch_.position[id], Lanes{}, id, kNone, kNone, fans_->valence[fan]});
    }
    patch_.closeLoop(first);
    setGate(first, h);
    setGate(first + 1, fans_->opposite[h]);
    return true;
}

void FrontEncoder::closed(uint32_t item, uint32_t prev) {
    // The triangle lies at the edges prev->item and item->next; the front now takes its third edge.
    setGate(prev, fans_->opposite[nextHalfEdge(gate_[item])]);
}

void FrontEncoder::added(uint32_t pivot, uint32_t fresh) {
    setGate(pivot, fans_->opposite[previousHalfEdge(at_)]);
    setGate(fresh, fans_->opposite[nextHalfEdge(at_)]);
}

void FrontEncoder::writeCopies() {
    uint32_t before = 0;
    for (const auto& [copy, original] : copies_) {
        out_[kCopies].push_back(copy - before);
        out_[kCopyOrigins].push_back(copy - original);
        before = copy;
    }
}

void FrontEncoder::writeNormals() {
    normals_.predict(patch_.position, patch_.triangle, header_.normal_bits);
    for (uint32_t id = 0; id < patch_.vertices; ++id) {
        const bool border = id < patch_.border_vertices;
        if (border && patch_.shared[id] != kNone) continue;
        const auto code = quantisedNormal(mesh_->normal[vertexOf(id)], header_.normal_bits);
        const size_t sequence = border ? kBorderNormalX : kNormalX;
        out_[sequence].push_back(zigzag(uint32_t(code[0] - normals_.x()[id])));
        out_[sequence + 1].push_back(zigzag(uint32_t(code[1] - normals_.y()[id])));
    }
}

void FrontEncoder::writeValues() {
    const auto scalars = size_t(header_.scalar_count);
    if (!header_.colours && scalars == 0) return;
    for (uint32_t id = 0; id < patch_.vertices; ++id) {
        if (id < patch_.border_vertices && patch_.shared[id] != kNone) continue;
        const auto [a, b] = patch_.parents[id];
        const uint32_t v = vertexOf(id);
        size_t sequence = kAttributeValues;
        if (header_.colours)
            for (const auto channel : kChannels) {
                const uint8_t expected = a == id ? 0
                                                 : average(mesh_->colour[vertexOf(a)].*channel,
                                                           mesh_->colour[vertexOf(b)].*channel);
                out_[sequence++].push_back(
                    zigzagByte(uint8_t(mesh_->colour[v].*channel - expected)));
            }
        for (size_t s = 0; s < scalars; ++s) {
            const auto bits = [&](uint32_t vertex) {
                return std::bit_cast<uint32_t>(mesh_->scalar[vertex * scalars + s]);
            };
            out_[sequence++].push_back(zigzag(bits(v) - (a == id ? 0 : bits(vertexOf(a)))));
        }
    }
}

/// What the decoder will have made of this patch, for the patches after it and for the check.
void FrontEncoder::finishOrder(uint32_t patch) {
    order_->vertex.clear();
    std::vector<uint32_t> origin(patch_.border_vertices);
    size_t copy = 0;
    for (uint32_t id = 0; id < patch_.vertices; ++id) {
        if (id < patch_.border_vertices) origin[id] = vertexOf(id);
        if (copy < copies_.size() && copies_[copy][0] == id)
            ++copy;
        else
            order_->vertex.push_back(vertexOf(id));
    }
    const size_t begin = shared_.size();
    appendShared(patch_, patch, origin, shared_.list());
    shared_.add(begin);
}

/// The largest m for which all interior vertices are multiples of 2^(shift + m).
int commonShift(const PageHeader& header, std::span<const Mesh* const> patches,
                std::span<const FanMesh> fans) {
    int32_t any = 0;
    for (size_t i = 0; i < patches.size(); ++i)
        for (size_t fan = 0; fan < fans[i].origin.size(); ++fan)
            if (fans[i].border[fan] == kNone) {
                const Vec3i& p = patches[i]->position[fans[i].origin[fan]];
                any |= p.x | p.y | p.z;
            }
    const int zeros = any == 0 ? header.shift : std::countr_zero(uint32_t(any));
    return std::clamp(zeros, header.shift, kMaxLatticeShift) - header.shift;
}

void writeEdgeClasses(std::span<const Mesh* const> patches, std::span<const PatchOrder> orders,
                      std::vector<uint32_t>& out) {
    bool any = false;
    for (const Mesh* mesh : patches)
        any = any || std::ranges::any_of(mesh->edge_class, [](uint8_t c) { return c != 0; });
    if (!any) return;
    for (size_t i = 0; i < patches.size(); ++i)
        for (const uint32_t h : orders[i].first_corner)
            out.push_back(rotateClasses(patches[i]->edge_class[h >> 2], h & 3));
}

/// Whether a decoded patch is the mesh in the order stated.
bool sameMesh(const Mesh& decoded, const Mesh& mesh, const PatchOrder& order,
              const PageHeader& header) {
    const size_t n = mesh.vertexCount(), m = mesh.triangleCount();
    const auto scalars = size_t(header.scalar_count);
    if (decoded.vertexCount() != n || decoded.triangleCount() != m || order.vertex.size() != n)
        return false;
    for (size_t i = 0; i < n; ++i) {
        const uint32_t v = order.vertex[i];
        const auto code = quantisedNormal(mesh.normal[v], header.normal_bits);
        const OctNormal normal = {int16_t(restoreNormal(code[0], header.normal_bits)),
                                  int16_t(restoreNormal(code[1], header.normal_bits))};
        if (decoded.position[i] != mesh.position[v] || decoded.normal[i] != normal) return false;
        if (header.colours && decoded.colour[i] != mesh.colour[v]) return false;
        if (scalars > 0 && std::memcmp(&decoded.scalar[i * scalars], &mesh.scalar[v * scalars],
                                       scalars * sizeof(float)) != 0)
            return false;
    }
    for (size_t i = 0; i < m; ++i) {
        const uint32_t h = order.first_corner[i];
        const Triangle& t = mesh.triangle[h >> 2];
        const uint32_t k = h & 3;
        if (order.vertex[decoded.triangle[i][0]] != t[k] ||
            order.vertex[decoded.triangle[i][1]] != t[k == 2 ? 0 : k + 1] ||
            order.vertex[decoded.triangle[i][2]] != t[k == 0 ? 2 : k - 1] ||
            decoded.edge_class[i] != rotateClasses(mesh.edge_class[h >> 2], k))
            return false;
    }
    return true;
}

}  // namespace

bool encodeFront(const PageHeader& header, std::span<const Mesh* const> patches,
                 ByteWriter& writer) {
    const size_t count = patches.size();
    // Not kept: pages of many small patches and of few large ones would leave room for many large.
    std::vector<FanMesh> fans(count);
    std::vector<PatchOrder> orders(count);
    thread_local Sequences sequences;
    sequences.resize(sequenceCount(header));
    for (std::vector<uint32_t>& sequence : sequences) sequence.clear();
    for (size_t i = 0; i < count; ++i)
        if (!fans[i].build(*patches[i])) return false;

    const int m = commonShift(header, patches, fans);
    FrontEncoder encoder(header, patches, m, sequences);
    for (uint32_t i = 0; i < count; ++i)
        if (!encoder.encode(i, fans[i], orders[i])) return false;
    writeEdgeClasses(patches, orders, sequences[kEdgeClasses]);
    std::vector<std::byte> body;
    ByteWriter body_writer(body);
    body_writer.fixed(uint8_t(m));
    thread_local StreamPacker packer;
    writeSequences(sequences, packer, body_writer);

    // Trust is good: a model is for ever, and this body is not simple.
    std::vector<Mesh> decoded(count);
    std::string fault;
    ByteReader reader(body);
    if (!decodeFront(header, reader, decoded, fault)) return false;
    for (size_t i = 0; i < count; ++i)
        if (!sameMesh(decoded[i], *patches[i], orders[i], header)) return false;
    writer.raw(body.data(), body.size());
    return true;
}

}  // namespace pietra
