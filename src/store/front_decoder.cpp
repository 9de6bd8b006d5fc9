#include <fmt/format.h>

#include <bit>

#include "geometry/lattice.h"
#include "store/front_body.h"
#include "store/front_codec.h"
#include "store/sequences.h"

namespace pietra {

namespace {

constexpr uint32_t kPositionMask = (1u << kLatticeBits) - 1;

/// Hands out the numbers of a sequence; zeros, and a note, once there are none left.
class Cursor {
public:
    void start(std::span<const uint32_t> numbers) {
        at_ = numbers.data();
        end_ = at_ + numbers.size();
        missing_ = false;
    }
    uint32_t next() {
        if (at_ == end_) [[unlikely]] {
            missing_ = true;
            return 0;
        }
        return *at_++;
    }
    /// All were handed out, and no more were asked for.
    bool spent() const { return at_ == end_ && !missing_; }
    bool missing() const { return missing_; }

private:
    const uint32_t* at_ = nullptr;
    const uint32_t* end_ = nullptr;
    bool missing_ = false;
};

/// Rebuilds patch after patch of a page. The `Side` of FrontWalk.
class FrontDecoder {
public:
    FrontDecoder(const PageHeader& header, int coarse_shift,
                 std::span<const std::vector<uint32_t>> sequences)
        : header_(header), m_(coarse_shift), in_(sequences.size()) {
        for (size_t i = 0; i < sequences.size(); ++i) in_[i].start(sequences[i]);
    }

    [[nodiscard]] bool decode(const PatchHeader& patch, Mesh& mesh);
    bool spent() const {
        return std::ranges::all_of(in_, [](const Cursor& cursor) { return cursor.spent(); });
    }

    // What FrontWalk asks.
    bool triangle(uint32_t first, uint32_t b, uint32_t c) {
        if (patch_.triangle.size() == triangles_) return false;
        patch_.triangle.push_back({patch_.items[first].vertex, b, c});
        return true;
    }
    uint32_t symbol(uint32_t) { return in_[kSymbols].next(); }
    bool vertex(uint32_t pivot, uint32_t next, uint32_t prev, uint32_t valence, uint32_t& id);
    bool split(uint32_t pivot, uint32_t next, uint32_t& target, uint32_t& left);
    bool seed();
    void closed(uint32_t, uint32_t) {}
    void added(uint32_t, uint32_t) {}
    void joined(uint32_t, uint32_t) {}

private:
    bool readCopies(uint32_t count, uint32_t vertices);
    bool startLoops(uint32_t count);
    bool addBorderVertex(uint32_t parent);
    bool isCopy() {
        return next_copy_ < copies_.size() && copies_[next_copy_][0] == patch_.position.size();
    }
    Vec3i readInterior(const Prediction& prediction);
    bool storeMesh(Mesh& mesh);
    void readAttributes(Mesh& mesh);
    void dropCopies(Mesh& mesh);

    const PageHeader& header_;
    const int m_;
    std::vector<Cursor> in_;
    FrontPatch patch_;
    size_t triangles_ = 0;
    size_t vertices_ = 0;
    std::vector<std::array<uint32_t, 2>> copies_;  // number, number of its original; ascending
    size_t next_copy_ = 0;
    Vec3i last_border_{0, 0, 0};
    uint32_t outside_ = 0;  // not 0: some position was out of range
    std::vector<std::array<int32_t, 2>> predicted_;
};

bool FrontDecoder::decode(const PatchHeader& patch, Mesh& mesh) {
    const uint32_t loops = in_[kPatchCounts].next();
    const uint32_t components = in_[kPatchCounts].next();
    const uint32_t copies = in_[kPatchCounts].next();
    // A copy has triangles of its own, a corner each at least.
    if (copies > 3 * uint64_t(patch.triangles)) return false;
    triangles_ = patch.triangles;
    vertices_ = size_t(patch.vertices) + copies;
    patch_.items.clear();
    patch_.position.clear();
    patch_.triangle.clear();
    patch_.parents.clear();
    patch_.items.reserve(vertices_ + vertices_ / 8);
    patch_.position.reserve(vertices_);
    patch_.triangle.reserve(triangles_);
    patch_.parents.reserve(vertices_);
    last_border_ = patch.corner;
    outside_ = 0;
    if (!readCopies(copies, uint32_t(vertices_)) || !startLoops(loops)) return false;
    patch_.border_vertices = uint32_t(patch_.position.size());
    FrontWalk<FrontDecoder> walk(*this, patch_.items);
    if (!walk.run(components) || patch_.triangle.size() != triangles_ ||
        patch_.position.size() != vertices_ || outside_ != 0)
        return false;
    patch_.vertices = uint32_t(vertices_);
    return storeMesh(mesh);
}

bool FrontDecoder::readCopies(uint32_t count, uint32_t vertices) {
    copies_.clear();
    next_copy_ = 0;
    uint32_t before = 0;
    for (uint32_t i = 0; i < count; ++i) {
        const uint64_t copy = uint64_t(before) + in_[kCopies].next();
        const uint32_t back = in_[kCopyOrigins].next();
        if (copy >= vertices || (i > 0 && copy == before) || back == 0 || back > copy) return false;
        before = uint32_t(copy);
        copies_.push_back({before, before - back});
    }
    return true;
}

bool FrontDecoder::startLoops(uint32_t count) {
    for (uint32_t loop = 0; loop < count; ++loop) {
        const uint32_t length = in_[kLoopLengths].next();
        const auto first = uint32_t(patch_.items.size());
        if (length == 0 || length > vertices_ - patch_.position.size()) return false;
        for (uint32_t i = 0; i < length; ++i) {
            const uint32_t item = first + i;
            const uint32_t valence = in_[kBorderValences].next();
            if (valence == 0 || !addBorderVertex(i == 0 ? kNone : item - 1)) return false;
            patch_.items.push_back({item, item - 1, item + 1, valence, kNone});
        }
        patch_.items[first].prev = first + length - 1;
        patch_.items.back().next = first;
    }
    return true;
}

bool FrontDecoder::addBorderVertex(uint32_t parent) {
    const auto id = uint32_t(patch_.position.size());
    if (id == vertices_) return false;
    if (parent == kNone) parent = id;
    patch_.parents.push_back({parent, parent});
    if (isCopy()) {
        last_border_ = patch_.position[copies_[next_copy_++][1]];
    } else {
        const uint32_t top = uint32_t(kLatticeMax) >> header_.shift;
        for (int a = 0; a < 3; ++a) {
            const uint32_t x = uint32_t(last_border_[a]) + unzigzag(in_[kBorderX + a].next());
            outside_ |= uint32_t(x > top);
            last_border_[a] = int32_t(x & kPositionMask);
        }
    }
    patch_.position.push_back(last_border_);
    return true;
}

Vec3i FrontDecoder::readInterior(const Prediction& prediction) {
    const int w = prediction.axis;
    const int u = w == 2 ? 0 : w + 1, v = u == 2 ? 0 : u + 1;
    const uint32_t top = uint32_t(kLatticeMax) >> header_.shift;
    Vec3i p;
    const auto read = [&](int axis, int sequence, int32_t predicted) {
        const uint32_t x =
            (uint32_t(toCoarse(predicted, m_)) + unzigzag(in_[kInteriorU + sequence].next())) << m_;
        outside_ |= uint32_t(x > top);
        p[axis] = int32_t(x & kPositionMask);
    };
    read(u, 0, prediction.point[u]);
    read(v, 1, prediction.point[v]);
    const double lift = prediction.slope[u] * double(p[u] - prediction.point[u]) +
                        prediction.slope[v] * double(p[v] - prediction.point[v]);
    read(w, 2, prediction.point[w] + int32_t(std::floor(lift + 0.5)));
    return p;
}

bool FrontDecoder::vertex(uint32_t pivot, uint32_t next, uint32_t, uint32_t, uint32_t& id) {
    id = uint32_t(patch_.position.size());
    if (id == vertices_) return false;
    const bool copy = isCopy();
    const Vec3i p = copy ? patch_.position[copies_[next_copy_++][1]]
                         : readInterior(predictVertex(patch_.items, patch_.position, pivot));
    patch_.parents.push_back({patch_.items[pivot].vertex, patch_.items[next].vertex});
    patch_.position.push_back(p);
    return true;
}

bool FrontDecoder::split(uint32_t pivot, uint32_t next, uint32_t& target, uint32_t& left) {
    const uint32_t code = in_[kSplitTargets].next();
    left = in_[kSplitParts].next() + 1;
    if (code >= kSplitSteps) {
        target = code - kSplitSteps;
        return true;
    }
    const bool forward = code % 2 == 0;
    target = forward ? patch_.items[next].next : patch_.items[pivot].prev;
    for (uint32_t step = code / 2; step > 0; --step)
        target = forward ? patch_.items[target].next : patch_.items[target].prev;
    return true;
}

bool FrontDecoder::seed() {
    const auto first = uint32_t(patch_.items.size());
    for (uint32_t k = 0; k < 2; ++k) {
        const auto id = uint32_t(patch_.position.size());
        const uint32_t valence = in_[kBorderValences].next();
        if (valence < 2 || !addBorderVertex(k == 0 ? kNone : id - 1)) return false;
        patch_.items.push_back({id, first + 1 - k, first + 1 - k, valence, kNone});
    }
    return true;
}

bool FrontDecoder::storeMesh(Mesh& mesh) {
    mesh.position.resize(vertices_);
    for (size_t v = 0; v < vertices_; ++v) mesh.position[v] = patch_.position[v] << header_.shift;
    mesh.triangle = patch_.triangle;
    mesh.edge_class.resize(triangles_);
    uint32_t bad = 0;
    for (uint8_t& classes : mesh.edge_class) {
        const uint32_t value = in_[kEdgeClasses].next();
        bad |= value >> 6;
        classes = uint8_t(value);
    }
    readAttributes(mesh);
    if (!copies_.empty()) dropCopies(mesh);
    return bad == 0;
}

void FrontDecoder::readAttributes(Mesh& mesh) {
    const auto scalars = size_t(header_.scalar_count);
    mesh.normal.resize(vertices_);
    mesh.colour.resize(header_.colours ? vertices_ : 0);
    mesh.scalar.resize(vertices_ * scalars);
    predictNormals(patch_, header_.normal_bits, predicted_);
    const int32_t top = (1 << (header_.normal_bits - 1)) - 1;
    next_copy_ = 0;
    for (uint32_t id = 0; id < vertices_; ++id) {
        if (next_copy_ < copies_.size() && copies_[next_copy_][0] == id) {
            const uint32_t original = copies_[next_copy_++][1];
            mesh.normal[id] = mesh.normal[original];
            if (header_.colours) mesh.colour[id] = mesh.colour[original];
            for (size_t s = 0; s < scalars; ++s)
                mesh.scalar[id * scalars + s] = mesh.scalar[original * scalars + s];
            continue;
        }
        std::array<int32_t, 2> code;
        for (int k = 0; k < 2; ++k) {
            code[k] = int32_t(uint32_t(predicted_[id][k]) + unzigzag(in_[kNormalX + k].next()));
            outside_ |= uint32_t(code[k] > top) | uint32_t(code[k] < -top);
            code[k] = std::clamp(code[k], -top, top);
        }
        mesh.normal[id] = {int16_t(restoreNormal(code[0], header_.normal_bits)),
                           int16_t(restoreNormal(code[1], header_.normal_bits))};
        const auto [a, b] = patch_.parents[id];
        size_t sequence = kAttributeValues;
        if (header_.colours)
            for (const auto channel : kChannels) {
                const uint8_t predicted =
                    a == id ? 0 : average(mesh.colour[a].*channel, mesh.colour[b].*channel);
                mesh.colour[id].*channel =
                    uint8_t(predicted + unzigzagByte(uint8_t(in_[sequence++].next())));
            }
        for (size_t s = 0; s < scalars; ++s) {
            const uint32_t predicted =
                a == id ? 0 : std::bit_cast<uint32_t>(mesh.scalar[a * scalars + s]);
            mesh.scalar[id * scalars + s] =
                std::bit_cast<float>(predicted + unzigzag(in_[sequence++].next()));
        }
    }
}

/// Lets triangles use the originals, and closes the gaps that copies leave.
void FrontDecoder::dropCopies(Mesh& mesh) {
    std::vector<uint32_t> number(vertices_);
    const auto scalars = size_t(header_.scalar_count);
    uint32_t kept = 0;
    size_t copy = 0;
    for (uint32_t id = 0; id < vertices_; ++id) {
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
    sequences.resize(sequenceCount(header));
    if (!readSequences(reader, each * sequences.size(), unpacker, sequences, fault)) return false;
    FrontDecoder decoder(header, m, sequences);
    for (size_t i = 0; i < patches.size(); ++i)
        if (!decoder.decode(header.patches[i], patches[i])) {
            fault = fmt::format("patch {} does not unfold", i);
            return false;
        }
    if (!decoder.spent()) fault = "its sequences are not used up";
    return decoder.spent();
}

}  // namespace pietra
