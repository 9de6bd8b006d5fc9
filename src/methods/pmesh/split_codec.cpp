#include "methods/pmesh/split_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "methods/pmesh/split_faults.h"
#include "store/columns.h"

namespace pietra::pmesh {
namespace {

constexpr uint8_t kSplitsCodec = 4;

/// Columns of numbers on their way into or out of bytes.
class Columns {
public:
    std::vector<std::vector<uint32_t>> column;

    void begin(size_t count) {
        column.resize(count);
        for (auto& c : column) c.clear();
        next_.assign(count, 0);
        ok_ = true;
    }

    void write(ByteWriter& writer) {
        StreamPacker packer;
        std::vector<uint8_t> planes;
        for (const auto& c : column) {
            writer.varint(c.size());
            packColumn(c, packer, planes);
        }
        for (const uint8_t p : planes) writer.fixed(p);
        packer.write(writer);
    }

    [[nodiscard]] bool read(ByteReader& reader, uint32_t longest, std::string& fault) {
        for (auto& c : column) c.resize(reader.varintUpTo(longest));
        std::vector<uint8_t> planes;
        for (size_t i = 0; i < column.size(); ++i) planes.push_back(reader.fixed<uint8_t>());
        const size_t count = std::accumulate(planes.begin(), planes.end(), size_t(0));
        if (*std::max_element(planes.begin(), planes.end()) > 4)
            return fault = "its header is not one this version knows", false;
        if (!reader.ok()) return fault = "its header is cut short", false;
        StreamUnpacker streams;
        if (!streams.read(reader, count, longest, uint64_t(longest) * count, fault)) return false;
        size_t stream = 0;
        for (size_t i = 0; i < column.size(); ++i) {
            for (size_t p = 0; p < planes[i]; ++p)
                if (streams[stream + p].size() != column[i].size())
                    return fault = "its columns have different lengths", false;
            unpackColumn(streams, stream, planes[i], 0, column[i]);
            stream += planes[i];
        }
        return true;
    }

    void put(size_t i, uint32_t value) { column[i].push_back(value); }
    /// 0 where there is none left, and not ok from then on.
    uint32_t get(size_t i) {
        if (next_[i] == column[i].size()) return ok_ = false, 0;
        return column[i][next_[i]++];
    }
    bool ok() const { return ok_; }
    bool allRead() const {
        for (size_t i = 0; i < column.size(); ++i)
            if (next_[i] != column[i].size()) return false;
        return true;
    }

private:
    std::vector<size_t> next_;
    bool ok_ = true;
};

enum Column : size_t {
    kKinds,    // of both children, two bits each, and what it brings
    kLeaves,   // below ends whose next split is in a child node
    kCornerV,  // of both triangles, where v has several leaves
    kCornerU,  // likewise
    kCornerW,  // likewise, of all
    kOffset,   // along each axis u's, then what it takes to make v's
    kNormalV,  // in each byte
    kNormalU,
    kError,
    kScale,
    kReach,      // of the box along each axis: below, above
    kNormalBox,  // along each axis
    kWord,       // of a colour eight, then of each scalar two
};
/// In any column, of a node.
constexpr uint32_t kMostNumbers = 6 * kSplitSlots;
size_t columnCount(WordLayout layout) {
    return kWord + 8 * layout.colours + 2 * layout.scalars;
}

/// One statement of the order and of the predictions for both directions.
template <bool kDecode>
class NodeCoder {
public:
    NodeCoder(Columns& columns, SplitNode& node) : columns_(columns), node_(node) {}

    /// False only if the columns are not those of a node.
    bool run() {
        std::array<uint32_t, 3> next{node_.frontier, 0, 0};
        for (uint32_t s = 0; s < node_.split.size(); ++s) {
            const bool from_above = s < node_.frontier;
            if (!from_above && s - node_.frontier >= above_.size()) return false;
            parent_ = from_above ? Parent{} : above_[s - node_.frontier];
            codeSplit(s, next);
        }
        if constexpr (!kDecode) return true;
        return columns_.ok() && columns_.allRead() && addUp();
    }

private:
    struct Parent {
        uint32_t slot = kSplitSlots;  ///< none in this node
        uint32_t end = 0;
    };

    bool inside() const { return parent_.slot != kSplitSlots; }

    /// A number of `kBits` bits as its difference, modulo 2^kBits.
    template <uint32_t kBits, class T>
    void number(size_t column, T& value, uint32_t predicted, bool is_signed) {
        constexpr uint32_t kMask = kBits == 32 ? ~0u : (1u << kBits) - 1;
        if constexpr (kDecode) {
            const uint32_t code = columns_.get(column);
            value = T((predicted + (is_signed ? unzigzag(code) : code)) & kMask);
        } else {
            const uint32_t difference = (uint32_t(value) - predicted) & kMask;
            const uint32_t extended = difference >> (kBits - 1) ? difference | ~kMask : difference;
            columns_.put(column, is_signed ? zigzag(extended) & kMask : difference);
        }
    }

    void codeSplit(uint32_t s, std::array<uint32_t, 3>& next);
    void codeChildren(uint32_t s, std::array<uint32_t, 3>& next);
    void codeCorners(VertexSplit& split, uint32_t kinds);
    void codeOffsets(VertexSplit& split);
    void codeNormals(VertexSplit& split, uint32_t s);
    void codeCriterion(VertexSplit& split, uint32_t s);
    void codeWords(uint32_t s);
    bool addUp();

    Columns& columns_;
    SplitNode& node_;
    Parent parent_;
    std::vector<Parent> above_;  // of slots beyond the frontier, so far
};

template <bool kDecode>
void NodeCoder<kDecode>::codeSplit(uint32_t s, std::array<uint32_t, 3>& next) {
    VertexSplit& split = node_.split[s];
    codeChildren(s, next);
    codeOffsets(split);
    codeNormals(split, s);
    codeCriterion(split, s);
    codeWords(s);
}

template <bool kDecode>
void NodeCoder<kDecode>::codeChildren(uint32_t s, std::array<uint32_t, 3>& next) {
    VertexSplit& split = node_.split[s];
    uint32_t kinds = split.brings << 4u;
    for (uint32_t end = 0; end < 2 && !kDecode; ++end)
        if (split.child[end] != kNoChildSplit)
            kinds |= (1u + split.child[end] / kSplitSlots) << (2 * end);
    number<8>(kKinds, kinds, 0, false);
    split.brings = uint8_t(kinds >> 4 & 7);
    for (uint32_t end = 0; end < 2; ++end) {
        const uint32_t kind = kinds >> (2 * end) & 3;
        if (kDecode) split.child[end] = kNoChildSplit, split.leaves[end] = 1;
        if (kind == 0) continue;
        const uint32_t slot = std::min(next[kind - 1]++, kSplitSlots - 1);
        split.child[end] = uint16_t(slot + (kind - 1) * kSplitSlots);
        if (kind == 1)
            above_.push_back({s, end});
        else
            number<32>(kLeaves, split.leaves[end], 0, false);
    }
    codeCorners(split, kinds);
}

/// Third corners lie outside of the range that is parted: how far on either side. Decoded they
/// remain so until the range is known.
template <bool kDecode>
void NodeCoder<kDecode>::codeCorners(VertexSplit& split, uint32_t kinds) {
    for (const uint32_t side : {0u, 1u}) {
        if ((split.brings >> side & 1) == 0) continue;
        VertexSplit::Corners& c = split.corner[side];
        if ((kinds & 3) != 0) number<32>(kCornerV, c.v, 0, false);
        if ((kinds >> 2 & 3) != 0) number<32>(kCornerU, c.u, 0, false);
        uint32_t w = 0;
        if constexpr (!kDecode) {
            const int64_t before = -int64_t(split.leaves[0]) - 1 - c.w;
            w = before >= 0 ? uint32_t(before) << 1 | 1u
                            : uint32_t(c.w - int64_t(split.leaves[1])) << 1;
        }
        number<32>(kCornerW, w, 0, false);
        if constexpr (kDecode) c.w = int32_t(w);
    }
}

/// The leaves below splits of the own node, and corners that depend on them.
template <bool kDecode>
bool NodeCoder<kDecode>::addUp() {
    for (size_t s = node_.split.size(); s-- > 0;) {
        VertexSplit& split = node_.split[s];
        uint64_t sum = 0;
        for (const uint32_t end : {0u, 1u}) {
            const uint16_t child = split.child[end];
            if (child < kSplitSlots) {
                if (child >= node_.split.size() || child <= s) return false;
                split.leaves[end] = node_.split[child].leaves[0] + node_.split[child].leaves[1];
            }
            sum += split.leaves[end];
        }
        if (sum >= 1u << 31) return false;
        for (const uint32_t side : {0u, 1u}) {
            if ((split.brings >> side & 1) == 0) continue;
            const auto w = uint32_t(split.corner[side].w);
            const int64_t third = w & 1 ? -int64_t(split.leaves[0]) - 1 - (w >> 1)
                                        : int64_t(split.leaves[1]) + (w >> 1);
            if (third != int32_t(third)) return false;
            split.corner[side].w = int32_t(third);
        }
    }
    return true;
}

/// v and u go about as far, in opposite directions.
template <bool kDecode>
void NodeCoder<kDecode>::codeOffsets(VertexSplit& split) {
    for (int k = 0; k < 3; ++k) {
        uint32_t u = uint32_t(split.offset[1][k]), v = uint32_t(split.offset[0][k]);
        number<32>(kOffset, u, 0, true);
        number<32>(kOffset, v, 0u - u, true);
        split.offset[1][k] = int32_t(u);
        split.offset[0][k] = int32_t(v);
    }
}

/// The vertex before had about the mean of both.
template <bool kDecode>
void NodeCoder<kDecode>::codeNormals(VertexSplit& split, uint32_t s) {
    for (const uint32_t byte : {0u, 8u}) {
        const auto at = [&](uint16_t n) { return uint32_t(n) >> byte & 255u; };
        const uint32_t before = inside() ? at(node_.split[parent_.slot].normal[parent_.end])
                                : s > 0  ? at(node_.split[s - 1].normal[0])
                                         : 0;
        uint32_t v = at(split.normal[0]), u = at(split.normal[1]);
        number<8>(kNormalV, v, before, true);
        number<8>(kNormalU, u, inside() ? 2 * before - v : v, true);
        split.normal[0] = uint16_t((split.normal[0] & (0xff00u >> byte)) | v << byte);
        split.normal[1] = uint16_t((split.normal[1] & (0xff00u >> byte)) | u << byte);
    }
}

/// Errors below the one above; or near the one before.
template <bool kDecode>
void NodeCoder<kDecode>::codeCriterion(VertexSplit& split, uint32_t s) {
    LocalCriterion& c = split.criterion;
    const LocalCriterion first{};
    const LocalCriterion& like = inside() ? node_.split[parent_.slot].criterion
                                 : s > 0  ? node_.split[s - 1].criterion
                                          : first;
    uint32_t error = 0xffffu - c.error;
    number<16>(kError, error, 0xffffu - like.error, !inside());
    c.error = uint16_t(0xffffu - error);
    number<8>(kScale, c.scale, like.scale, true);
    for (size_t k = 0; k < 3; ++k) {
        number<8>(kReach, c.below[k], 0, false);
        number<8>(kReach, c.above[k], 0, false);
        // Of what lies above, the normals are no fewer.
        const int32_t low = inside() ? like.normals.low(k) : -NormalBox::kUnit;
        const int32_t high = inside() ? like.normals.high(k) : NormalBox::kUnit;
        uint32_t code = uint32_t(c.normals.low(k) - low) & 15u;
        code |= (uint32_t(high - c.normals.high(k)) & 15u) << 4;
        number<8>(kNormalBox, code, 0, false);
        if (kDecode) c.normals.set(k, low + int32_t(code & 15u), high - int32_t(code >> 4 & 15u));
    }
}

/// Colours as normals; scalars, floats of about the same size, by their bits.
template <bool kDecode>
void NodeCoder<kDecode>::codeWords(uint32_t s) {
    const size_t words = node_.layout.words();
    uint32_t* const v = node_.word.data() + 2 * words * s;
    const uint32_t* const before =
        inside() ? node_.word.data() + words * (2 * size_t(parent_.slot) + parent_.end)
        : s > 0  ? v - 2 * words
                 : nullptr;
    for (uint32_t byte = 0; byte < 4 * node_.layout.colours; ++byte) {
        const auto at = [&](uint32_t word) { return word >> (8 * byte) & 255u; };
        const uint32_t near = before ? at(before[0]) : 0;
        uint32_t of_v = at(v[0]), of_u = at(v[words]);
        number<8>(kWord + byte, of_v, near, true);
        number<8>(kWord + 4 + byte, of_u, inside() ? 2 * near - of_v : of_v, true);
        if (!kDecode) continue;
        v[0] |= of_v << (8 * byte);
        v[words] |= of_u << (8 * byte);
    }
    for (size_t i = node_.layout.colours; i < words; ++i) {
        const size_t column = kWord + 8 * node_.layout.colours + 2 * (i - node_.layout.colours);
        number<32>(column, v[i], before ? before[i] : 0, true);
        number<32>(column + 1, v[words + i], v[i], true);
    }
}

Columns& threadColumns(size_t count) {
    thread_local Columns columns;
    columns.begin(count);
    return columns;
}

void writeParts(ByteWriter& writer, std::span<const NestedCriterion> parts) {
    writer.varint(parts.size());
    for (const NestedCriterion& c : parts) {
        for (size_t k = 0; k < 3; ++k) writer.fixed(c.min[k]), writer.fixed(c.max[k]);
        writer.fixed(c.error);
        for (size_t k = 0; k < 3; ++k) writer.fixed(uint8_t(c.normals.bits() >> (8 * k)));
    }
}

void readParts(ByteReader& reader, std::vector<NestedCriterion>& parts) {
    parts.resize(reader.varintUpTo(kMostParts));
    for (NestedCriterion& c : parts) {
        for (size_t k = 0; k < 3; ++k)
            c.min[k] = reader.fixed<uint16_t>(), c.max[k] = reader.fixed<uint16_t>();
        c.error = reader.fixed<uint16_t>();
        uint32_t bits = 0;
        for (size_t k = 0; k < 3; ++k) bits |= uint32_t(reader.fixed<uint8_t>()) << (8 * k);
        c.normals = NormalBox::ofBits(bits);
    }
}

/// Columns of a base: of roots, then of triangles, then of roots again.
enum BaseColumn : size_t {
    kPosition,  // three
    kBaseNormal = kPosition + 3,
    kBaseLeaves,
    kBaseSplit,   // 0: none, else the difference to the next one
    kBaseCorner,  // three: the root, and, above, the leaf in it
    kBaseLeaf = kBaseCorner + 3,
    kBaseClosed = kBaseLeaf + 3,
    kBaseWord
};

}  // namespace

std::vector<std::byte> encodeSplitNode(const SplitNode& node) {
    Columns& columns = threadColumns(columnCount(node.layout));
    SplitNode copy = node;
    NodeCoder<false>(columns, copy).run();
    std::vector<std::byte> bytes;
    bytes.reserve(24 * kSplitSlots);
    ByteWriter writer(bytes);
    writer.fixed(kSplitsCodec);
    writer.varint(node.split.size());
    writer.varint(node.frontier);
    for (const auto& parts : node.child_parts) writeParts(writer, parts);
    columns.write(writer);
    return bytes;
}

bool decodeSplitNode(std::span<const std::byte> bytes, const SplitRow& row, WordLayout layout,
                     SplitNode& node, std::string& fault) {
    ByteReader reader(bytes);
    if (reader.fixed<uint8_t>() != kSplitsCodec || !reader.ok())
        return fault = "its codec is unknown", false;
    node.split.assign(reader.varintUpTo(kSplitSlots), {});
    node.frontier = reader.varintUpTo(uint32_t(node.split.size()));
    for (auto& parts : node.child_parts) readParts(reader, parts);
    node.layout = layout;
    node.word.assign(2 * layout.words() * node.split.size(), 0);
    Columns& columns = threadColumns(columnCount(layout));
    if (!columns.read(reader, kMostNumbers, fault)) return false;
    if (!NodeCoder<true>(columns, node).run())
        return fault = "its columns do not fit each other", false;
    fault = faultOf(row, node);
    return fault.empty();
}

std::vector<std::byte> encodeSplitBase(const SplitForest& forest) {
    const SplitBase& base = forest.base;
    Columns columns;
    columns.begin(kBaseWord + forest.layout.words());
    std::array<uint32_t, 3> position{};
    SplitId next = 0;
    std::vector<Leaf> first;
    for (const SplitBase::Root& root : base.root) {
        for (int k = 0; k < 3; ++k) {
            const auto p = uint32_t(root.vertex.position[k]);
            columns.put(kPosition + size_t(k), zigzag(p - position[size_t(k)]));
            position[size_t(k)] = p;
        }
        columns.put(kBaseNormal, root.vertex.normal);
        columns.put(kBaseLeaves, root.leaves);
        columns.put(kBaseSplit, root.split == kNoSplit ? 0 : zigzag(root.split - next) + 1);
        if (root.split != kNoSplit) next = root.split + 1;
        first.push_back(first.empty() ? 0 : first.back() + (&root)[-1].leaves);
    }
    for (size_t t = 0; t < base.triangle.size(); ++t) {
        for (size_t k = 0; k < 3; ++k) {
            const Leaf leaf = base.triangle[t][k];
            const auto root =
                uint32_t(std::upper_bound(first.begin(), first.end(), leaf) - first.begin() - 1);
            columns.put(kBaseCorner + k, root);
            columns.put(kBaseLeaf + k, leaf - first[root]);
        }
        columns.put(kBaseClosed, !base.closed.empty() && base.closed[t]);
    }
    for (size_t i = 0; i < base.word.size(); ++i)
        columns.put(kBaseWord + i % forest.layout.words(), base.word[i]);
    std::vector<std::byte> bytes;
    bytes.reserve(1024);
    ByteWriter writer(bytes);
    writer.fixed(uint8_t(forest.grid.shift));
    for (int k = 0; k < 3; ++k) writer.fixed(forest.grid.origin[k]);
    columns.write(writer);
    return bytes;
}

bool decodeSplitBase(std::span<const std::byte> bytes, SplitForest& forest, std::string& fault) {
    constexpr uint32_t kMost = 1u << 28;
    constexpr int kMostShift = 8;  // of the lattice's 21 bits to 16, and room for rounding
    ByteReader reader(bytes);
    forest.grid.shift = reader.fixed<uint8_t>();
    for (int k = 0; k < 3; ++k) forest.grid.origin[k] = reader.fixed<int32_t>();
    if (!reader.ok()) return fault = "its header is cut short", false;
    const auto off = [](const Vec3i& p) {
        return glm::any(glm::greaterThan(glm::abs(p), Vec3i(kLatticeMax)));
    };
    if (forest.grid.shift > kMostShift || off(forest.grid.origin))
        return fault = "its grid is not one of this lattice", false;
    Columns columns;
    columns.begin(kBaseWord + forest.layout.words());
    if (!columns.read(reader, uint32_t(std::min<uint64_t>(kMost, 4096 * bytes.size())), fault))
        return false;
    const size_t roots = columns.column[0].size(), triangles = columns.column[kBaseCorner].size();
    for (size_t i = 0; i < columns.column.size(); ++i)
        if (columns.column[i].size() != (i >= kBaseCorner && i < kBaseWord ? triangles : roots))
            return fault = "its columns have different lengths", false;
    SplitBase& base = forest.base;
    base = {};
    std::vector<uint32_t> referred(forest.row.size(), 0);
    std::vector<uint64_t> first;
    std::array<uint32_t, 3> position{};
    uint64_t leaves = 0;
    SplitId next = 0;
    for (size_t r = 0; r < roots; ++r) {
        SplitBase::Root root;
        for (size_t k = 0; k < 3; ++k) {
            position[k] += unzigzag(columns.get(kPosition + k));
            root.vertex.position[int(k)] = int32_t(position[k]);
        }
        if (off(root.vertex.position)) return fault = "a vertex is off the lattice", false;
        root.vertex.normal = uint16_t(columns.get(kBaseNormal));
        root.leaves = columns.get(kBaseLeaves);
        const uint32_t code = columns.get(kBaseSplit);
        if (code != 0) {
            root.split = next + unzigzag(code - 1);
            next = root.split + 1;
            const NodeIndex n = nodeOfSplit(root.split);
            if (n >= forest.row.size() || forest.row[n].parent != kNoNode ||
                slotOfSplit(root.split) != referred[n]++)
                return fault = fmt::format("vertex {} does not know its split", r), false;
        }
        if (root.leaves < 1u + (code != 0) || (code == 0 && root.leaves != 1))
            return fault = fmt::format("vertex {} has {} leaves", r, root.leaves), false;
        first.push_back(leaves);
        leaves += root.leaves;
        base.root.push_back(root);
        for (size_t i = 0; i < forest.layout.words(); ++i)
            base.word.push_back(columns.get(kBaseWord + i));
    }
    // Each split has a leaf more.
    uint64_t splits = 0;
    for (const SplitRow& row : forest.row) splits += row.splits;
    if (leaves != splits + roots)
        return fault = fmt::format("it has {} leaves, not {}", leaves, splits + roots), false;
    for (size_t t = 0; t < triangles; ++t) {
        std::array<Leaf, 3> corner;
        for (size_t k = 0; k < 3; ++k) {
            const uint32_t root = columns.get(kBaseCorner + k), leaf = columns.get(kBaseLeaf + k);
            if (root >= roots || leaf >= base.root[root].leaves)
                return fault = fmt::format("triangle {} has a corner that is not there", t), false;
            corner[k] = Leaf(first[root] + leaf);
        }
        base.triangle.push_back(corner);
        base.closed.push_back(columns.get(kBaseClosed) != 0);
    }
    return true;
}

}  // namespace pietra::pmesh
