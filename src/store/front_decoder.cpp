#include <fmt/format.h>

#include <algorithm>
#include <bit>

#include "geometry/lattice.h"
#include "store/front_body.h"
#include "store/front_codec.h"
#include "store/sequences.h"

namespace pietra {

namespace {

/// Hands out the numbers of a sequence; zeros, once there are none left, and then it is not
/// spent().
class Cursor {
public:
    void start(std::span<const uint32_t> numbers) {
        at_ = numbers.data();
        end_ = at_ + numbers.size();
    }
    uint32_t next() {
        if (at_ == end_) [[unlikely]] {
            missing_ = true;
            return 0;
        }
        return *at_++;
    }
    /// The next `count` numbers; false if there are not so many.
    [[nodiscard]] bool take(size_t count, std::span<const uint32_t>& numbers) {
        if (size_t(end_ - at_) < count) return false;
        numbers = {at_, count};
        at_ += count;
        return true;
    }
    /// All were handed out, and no more were asked for.
    bool spent() const { return at_ == end_ && !missing_; }

private:
    const uint32_t* at_ = nullptr;
    const uint32_t* end_ = nullptr;
    bool missing_ = false;
};

/// restoreNormal of every code, at [code + top].
std::span<const int16_t> restoredNormals(int bits) {
    static const auto tables = [] {
        std::array<std::vector<int16_t>, kMaxNormalBits + 1> all;
        for (int b = kMinNormalBits; b <= kMaxNormalBits; ++b) {
            const int32_t top = (1 << (b - 1)) - 1;
            for (int32_t code = -top; code <= top; ++code)
                all[b].push_back(int16_t(restoreNormal(code, b)));
        }
        return all;
    }();
    return tables[bits];
}

/// Rebuilds patch after patch of a page. The `Side` of FrontWalk.
class FrontDecoder {
public:
    FrontDecoder(const PageHeader& header, int coarse_shift,
                 std::span<const std::vector<uint32_t>> sequences, std::span<Mesh> meshes,
                 FrontPatch& patch)
        : header_(header),
          meshes_(meshes),
          coder_(coarse_shift),
          top_(float(kLatticeMax >> header.shift)),
          in_(sequences.size()),
          has_classes_(!sequences[kEdgeClasses].empty()),
          patch_(patch) {
        for (size_t i = 0; i < sequences.size(); ++i) in_[i].start(sequences[i]);
    }

    /// Patches in their order.
    [[nodiscard]] bool decode(uint32_t index);
    /// Every number of every sequence has been used.
    bool spent() const {
        return std::ranges::all_of(in_, [](const Cursor& cursor) { return cursor.spent(); });
    }

    // What FrontWalk asks.
    bool triangle(uint32_t first, uint32_t b, uint32_t c) {
        if (patch_.triangles == patch_.triangle.size()) return false;
        patch_.triangle[patch_.triangles++] = {patch_.items[first].vertex, b, c};
        return true;
    }
    uint32_t symbol(uint32_t) { return in_[kSymbols].next(); }
    bool vertex(uint32_t pivot, uint32_t& id, Lanes& at);
    bool split(uint32_t pivot, uint32_t& target, uint32_t& left);
    bool seed();
    void closed(uint32_t, uint32_t) {}
    void added(uint32_t, uint32_t) {}

private:
    using Copy = std::array<uint32_t, 2>;  // number, number of its original

    bool readCopies(uint32_t count);
    bool startLoops(uint32_t count);
    bool addBorderVertex(uint32_t parent, bool may_share);
    bool readShared(uint32_t& shared);
    bool isCopy() const {
        return next_copy_ < copies_.size() && copies_[next_copy_][0] == patch_.vertices;
    }
    bool isInside(Lanes at) const {
        const LaneMask inside = (at >= 0.0f) & (at <= top_);
        return (inside[0] & inside[1] & inside[2]) != 0;
    }
    /// What border vertex v is a repetition of, or null.
    const SharedVertex* sharedAt(uint32_t v) const {
        return v < patch_.border_vertices && patch_.shared[v] != kNone ? &shared_[patch_.shared[v]]
                                                                       : nullptr;
    }
    void storePositions(Mesh& mesh) const;
    bool readEdgeClasses(Mesh& mesh);
    bool readNormals(Mesh& mesh);
    void readColours(Mesh& mesh);
    void readScalars(Mesh& mesh);
    void dropCopies(Mesh& mesh);

    const PageHeader& header_;
    const std::span<Mesh> meshes_;
    const ResidualCoder coder_;
    const float top_;  // largest coordinate, in units of 2^shift
    std::vector<Cursor> in_;
    const bool has_classes_;
    FrontPatch& patch_;
    std::vector<Copy> copies_;  // ascending
    size_t next_copy_ = 0;
    Vec3i last_border_{0, 0, 0};
    LaneMask inside_{};                 // no interior position so far has been out of range
    std::vector<SharedVertex> shared_;  // border vertices of the patches before
    uint32_t expected_ = kNone;         // place of the one wanted next
    std::vector<uint32_t> final_vertex_;
    NormalPredictor normals_;
};

bool FrontDecoder::decode(uint32_t index) {
    const PatchHeader& patch = header_.patches[index];
    Mesh& mesh = meshes_[index];
    const uint32_t loops = in_[kPatchCounts].next();
    const uint32_t components = in_[kPatchCounts].next();
    const uint32_t copies = in_[kPatchCounts].next();
    // A copy has triangles of its own, a corner each at least.
    if (copies > 3 * uint64_t(patch.triangles)) return false;
    std::swap(patch_.triangle, mesh.triangle);
    patch_.reset(size_t(patch.vertices) + copies, patch.triangles);
    last_border_ = patch.corner;
    expected_ = kNone;
    inside_ = LaneMask{-1, -1, -1, -1};
    if (!readCopies(copies) || !startLoops(loops)) return false;
    FrontWalk<FrontDecoder> walk(*this, patch_.items);
    if (!walk.run(components) || (inside_[0] & inside_[1] & inside_[2]) == 0 ||
        patch_.triangles != patch_.triangle.size() || patch_.vertices != patch_.position.size())
        return false;
    storePositions(mesh);
    if (!readEdgeClasses(mesh) || !readNormals(mesh)) return false;
    readColours(mesh);
    readScalars(mesh);
    std::swap(patch_.triangle, mesh.triangle);
    final_vertex_.clear();
    if (!copies_.empty()) dropCopies(mesh);
    appendShared(patch_, index, final_vertex_, shared_);
    return true;
}

bool FrontDecoder::readCopies(uint32_t count) {
    copies_.clear();
    next_copy_ = 0;
    uint32_t before = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const uint64_t copy = uint64_t(before) + in_[kCopies].next();
        const uint32_t back = in_[kCopyOrigins].next();
        if (copy >= patch_.position.size() || (i > 0 && copy == before) || back == 0 || back > copy)
            return false;
        before = uint32_t(copy);
        copies_.push_back({before, before - back});
    }
    return true;
}

bool FrontDecoder::startLoops(uint32_t count) {
    for (uint32_t loop = 0; loop < count; ++loop) {
        const uint32_t length = in_[kLoopLengths].next();
        const uint32_t first = patch_.items.size();
        if (length == 0 || length > patch_.position.size() - patch_.vertices) return false;
        patch_.loop_begin.push_back(first);
        for (uint32_t item = first; item < first + length; ++item) {
            const uint32_t valence = in_[kBorderValences].next();
            if (valence == 0 || !addBorderVertex(item == first ? kNone : item - 1, true))
                return false;
            patch_.items.push({patch_.position[item], Lanes{}, item, kNone, kNone, valence});
        }
        patch_.closeLoop(first);
    }
    patch_.border_vertices = patch_.vertices;
    return true;
}

bool FrontDecoder::readShared(uint32_t& shared) {
    const uint32_t code = in_[kShared].next();
    if (code == kSharedNot) return true;
    if (code == kSharedAsExpected) {
        shared = expected_;
    } else {
        if (code - kSharedByDistance >= shared_.size()) return false;
        shared = uint32_t(shared_.size()) - 1 - (code - kSharedByDistance);
    }
    if (shared == kNone) return false;
    expected_ = shared_[shared].before;
    return true;
}

bool FrontDecoder::addBorderVertex(uint32_t parent, bool may_share) {
    if (patch_.vertices == patch_.position.size()) return false;
    const bool copy = isCopy();
    uint32_t shared = kNone;
    if (!copy && may_share && !readShared(shared)) return false;
    if (may_share) patch_.shared.push_back(shared);
    Lanes at;
    if (copy || shared != kNone) {
        at = copy ? patch_.position[copies_[next_copy_++][1]] : shared_[shared].at;
        last_border_ = toVec3i(at);
    } else {
        for (int a = 0; a < 3; ++a)
            last_border_[a] =
                int32_t(uint32_t(last_border_[a]) + unzigzag(in_[kBorderX + a].next()));
        at = toLanes(last_border_);
        if (!isInside(at)) return false;
    }
    if (parent == kNone) parent = patch_.vertices;
    patch_.addVertex(at, parent, parent);
    return true;
}

inline bool FrontDecoder::vertex(uint32_t pivot, uint32_t& id, Lanes& at) {
    if (patch_.vertices == patch_.position.size()) return false;
    if (isCopy()) [[unlikely]] {
        at = patch_.position[copies_[next_copy_++][1]];
    } else {
        const uint32_t u = in_[kInteriorU].next();
        const uint32_t v = in_[kInteriorU + 1].next();
        const uint32_t w = in_[kInteriorU + 2].next();
        at = coder_.decode(Prediction(patch_.items, pivot), u, v, w);
        inside_ &= (at >= 0.0f) & (at <= top_);
    }
    const FrontItem& v = patch_.items[pivot];
    id = patch_.addVertex(at, v.vertex, patch_.items[v.next].vertex);
    return true;
}

bool FrontDecoder::split(uint32_t pivot, uint32_t& target, uint32_t& left) {
    const uint32_t code = in_[kSplitTargets].next();
    left = in_[kSplitParts].next() + 1;
    const FrontItems& items = patch_.items;
    if (code >= kSplitSteps) {
        target = code - kSplitSteps;
    } else if (code % 2 == 0) {
        target = items[items[pivot].next].next;
        for (uint32_t step = code / 2; step > 0; --step) target = items[target].next;
    } else {
        target = items[pivot].prev;
        for (uint32_t step = code / 2; step > 0; --step) target = items[target].prev;
    }
    return true;
}

bool FrontDecoder::seed() {
    const uint32_t first = patch_.items.size();
    for (uint32_t k = 0; k < 2; ++k) {
        const uint32_t id = patch_.vertices;
        const uint32_t valence = in_[kBorderValences].next();
        if (valence < 2 || !addBorderVertex(k == 0 ? kNone : id - 1, false)) return false;
        patch_.items.push({patch_.position[id], Lanes{}, id, kNone, kNone, valence});
    }
    patch_.closeLoop(first);
    return true;
}

void FrontDecoder::storePositions(Mesh& mesh) const {
    const size_t n = patch_.position.size();
    mesh.position.resize(n);
    const auto unit = float(1 << header_.shift);
    for (size_t v = 0; v < n; ++v) {
        const Lanes at = patch_.position[v] * unit;
        mesh.position[v] = {int32_t(at[0]), int32_t(at[1]), int32_t(at[2])};
    }
}

bool FrontDecoder::readEdgeClasses(Mesh& mesh) {
    const size_t n = patch_.triangle.size();
    mesh.edge_class.assign(n, 0);
    if (!has_classes_) return true;
    std::span<const uint32_t> classes;
    if (!in_[kEdgeClasses].take(n, classes)) return false;
    uint32_t any = 0;
    for (size_t i = 0; i < n; ++i) {
        any |= classes[i];
        mesh.edge_class[i] = uint8_t(classes[i]);
    }
    return any >> 6 == 0;
}

bool FrontDecoder::readNormals(Mesh& mesh) {
    const size_t n = patch_.position.size();
    mesh.normal.resize(n);
    normals_.predict(patch_.position, patch_.triangle, header_.normal_bits);
    const std::span<const int32_t> x = normals_.x(), y = normals_.y();
    const std::span<const int16_t> restored = restoredNormals(header_.normal_bits);
    const auto top = uint32_t(restored.size() / 2);
    uint32_t bad = 0;
    const auto restore = [&](uint32_t v, uint32_t code_x, uint32_t code_y) {
        const uint32_t index_x = uint32_t(x[v]) + unzigzag(code_x) + top;
        const uint32_t index_y = uint32_t(y[v]) + unzigzag(code_y) + top;
        bad |= uint32_t(index_x > 2 * top) | uint32_t(index_y > 2 * top);
        return OctNormal{restored[std::min(index_x, 2 * top)],
                         restored[std::min(index_y, 2 * top)]};
    };
    const uint32_t border = patch_.border_vertices;
    for (uint32_t v = 0; v < border; ++v) {
        const SharedVertex* shared = sharedAt(v);
        if (shared != nullptr) {
            mesh.normal[v] = meshes_[shared->patch].normal[shared->vertex];
        } else {
            const uint32_t code_x = in_[kBorderNormalX].next();
            mesh.normal[v] = restore(v, code_x, in_[kBorderNormalY].next());
        }
    }
    std::span<const uint32_t> code_x, code_y;
    if (!in_[kNormalX].take(n - border, code_x) || !in_[kNormalY].take(n - border, code_y))
        return false;
    for (uint32_t v = border; v < n; ++v)
        mesh.normal[v] = restore(v, code_x[v - border], code_y[v - border]);
    return bad == 0;
}

void FrontDecoder::readColours(Mesh& mesh) {
    const size_t n = header_.colours ? patch_.position.size() : 0;
    mesh.colour.resize(n);
    for (uint32_t v = 0; v < n; ++v) {
        if (const SharedVertex* shared = sharedAt(v)) {
            mesh.colour[v] = meshes_[shared->patch].colour[shared->vertex];
            continue;
        }
        const auto [a, b] = patch_.parents[v];
        for (size_t k = 0; k < 4; ++k) {
            const auto channel = kChannels[k];
            const uint8_t expected =
                a == v ? 0 : average(mesh.colour[a].*channel, mesh.colour[b].*channel);
            const auto code = uint8_t(in_[kAttributeValues + k].next());
            mesh.colour[v].*channel = uint8_t(expected + unzigzagByte(code));
        }
    }
}

void FrontDecoder::readScalars(Mesh& mesh) {
    const auto scalars = size_t(header_.scalar_count);
    mesh.scalar.resize(patch_.position.size() * scalars);
    const size_t first = kAttributeValues + (header_.colours ? 4 : 0);
    for (size_t s = 0; s < scalars; ++s)
        for (uint32_t v = 0; v < patch_.position.size(); ++v) {
            float& value = mesh.scalar[v * scalars + s];
            if (const SharedVertex* shared = sharedAt(v)) {
                value = meshes_[shared->patch].scalar[shared->vertex * scalars + s];
                continue;
            }
            const uint32_t a = patch_.parents[v][0];
            const uint32_t expected =
                a == v ? 0 : std::bit_cast<uint32_t>(mesh.scalar[a * scalars + s]);
            value = std::bit_cast<float>(expected + unzigzag(in_[first + s].next()));
        }
}

/// Lets triangles use the originals, and closes the gaps that copies leave.
void FrontDecoder::dropCopies(Mesh& mesh) {
    std::vector<uint32_t>& number = final_vertex_;
    number.resize(mesh.vertexCount());
    const auto scalars = size_t(header_.scalar_count);
    uint32_t kept = 0;
    size_t copy = 0;
    for (uint32_t id = 0; id < number.size(); ++id) {
        if (copy < copies_.size() && copies_[copy][0] == id) {
            number[id] = number[copies_[copy++][1]];
            continue;
        }
        number[id] = kept;
        mesh.position[kept] = mesh.position[id];
        mesh.normal[kept] = mesh.normal[id];
        if (header_.colours) mesh.colour[kept] = mesh.colour[id];
        for (size_t s = 0; s < scalars; ++s)
            mesh.scalar[kept * scalars + s] = mesh.scalar[id * scalars + s];
        ++kept;
    }
    for (Triangle& t : mesh.triangle)
        for (uint32_t& v : t) v = number[v];
    mesh.position.resize(kept);
    mesh.normal.resize(kept);
    mesh.colour.resize(header_.colours ? kept : 0);
    mesh.scalar.resize(kept * scalars);
}

}  // namespace

bool decodeFront(const PageHeader& header, ByteReader& reader, std::vector<Mesh>& patches,
                 std::string& fault) {
    const int m = reader.fixed<uint8_t>();
    if (m + header.shift > kMaxLatticeShift) {
        fault = "its coarse lattice is impossible";
        return false;
    }
    // Every sequence has at most so many numbers: corners of triangles, or three counts a patch.
    const uint64_t each = 3 * (header.triangleCount() + header.patches.size());
    thread_local std::vector<std::vector<uint32_t>> sequences;
    thread_local StreamUnpacker unpacker;
    thread_local FrontPatch patch;
    sequences.resize(sequenceCount(header));
    if (!readSequences(reader, each * sequences.size(), unpacker, sequences, fault)) return false;
    FrontDecoder decoder(header, m, sequences, patches, patch);
    for (uint32_t i = 0; i < patches.size(); ++i)
        if (!decoder.decode(i)) {
            fault = fmt::format("patch {} does not unfold", i);
            return false;
        }
    if (!decoder.spent()) fault = "its sequences are not used up";
    return decoder.spent();
}

}  // namespace pietra
