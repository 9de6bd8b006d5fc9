#include "methods/pmesh/node_codec.h"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>

#include "store/columns.h"

namespace pietra::pmesh {
namespace {

constexpr uint8_t kOperationsCodec = 3, kCodecWithoutNormals = 2;

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
    kKinds,  // of both children
    kRanks,
    kShift,
    kLevel,  // above the parent's, or the difference to that of the slot before
    kReferenceLevel,
    kError,  // below the parent's, or likewise
    kRadius,
    kBefore,               // of dummies referred to from above: the parent's slot, 1 for none
    kDelta,                // six: u's, then what it takes to make v's
    kNormal = kDelta + 6,  // four
    kWord = kNormal + 4,   // of a colour eight, then of each scalar two
};
/// Then, but of kCodecWithoutNormals, three of the boxes of normals.
size_t columnCount(WordLayout layout, uint8_t codec) {
    const size_t boxes = codec == kCodecWithoutNormals ? 0 : 3;
    return kWord + 8 * layout.colours + 2 * layout.scalars + boxes;
}

/// One statement of the order and of the predictions for both directions.
template <bool kDecode>
class NodeCoder {
public:
    NodeCoder(Columns& columns, OperationNode& node, uint8_t codec)
        : columns_(columns),
          node_(node),
          first_box_(columnCount(node.layout, kCodecWithoutNormals)),
          has_boxes_(codec != kCodecWithoutNormals) {}

    /// False only if the columns are not those of a node.
    bool run() {
        std::array<uint32_t, 3> next{node_.frontier, 0, 0};
        for (uint32_t s = 0; s < node_.operation.size(); ++s) {
            const bool from_above = s < node_.frontier;
            if (!from_above && s - node_.frontier >= above_.size()) return false;
            parent_ = from_above ? Parent{} : above_[s - node_.frontier];
            codeOperation(s, next);
        }
        return !kDecode || (columns_.ok() && columns_.allRead());
    }

private:
    struct Parent {
        uint32_t slot = kNodeSlots;  ///< none in this node
        uint32_t end = 0;
    };

    /// A number of `kBits` bits as its difference, modulo 2^kBits.
    template <uint32_t kBits, class T>
    void number(size_t column, T& value, uint32_t predicted, bool is_signed) {
        constexpr uint32_t kMask = (1u << kBits) - 1;
        if constexpr (kDecode) {
            const uint32_t code = columns_.get(column);
            value = T((predicted + (is_signed ? unzigzag(code) : code)) & kMask);
        } else {
            const uint32_t difference = (uint32_t(value) - predicted) & kMask;
            const uint32_t extended = difference >> (kBits - 1) ? difference | ~kMask : difference;
            columns_.put(column, is_signed ? zigzag(extended) & kMask : difference);
        }
    }

    void whole(size_t column, uint32_t& value, uint32_t predicted) {
        if constexpr (kDecode)
            value = predicted + unzigzag(columns_.get(column));
        else
            columns_.put(column, zigzag(value - predicted));
    }

    void codeOperation(uint32_t s, std::array<uint32_t, 3>& next);
    uint32_t codeChild(uint32_t s, uint32_t end, uint32_t kind, uint32_t level,
                       std::array<uint32_t, 3>& next);
    uint32_t codeBefore(ChildCode before);
    void codeDeltas(NodeOperation& o);
    void codeNormals(NodeOperation& o, uint32_t s);
    void codeWords(uint32_t s);
    void codeBox(NodeOperation& o);

    Columns& columns_;
    OperationNode& node_;
    const size_t first_box_;
    const bool has_boxes_;
    Parent parent_;
    std::vector<Parent> above_;  // of slots beyond the frontier, so far
};

template <bool kDecode>
void NodeCoder<kDecode>::codeOperation(uint32_t s, std::array<uint32_t, 3>& next) {
    NodeOperation& o = node_.operation[s];
    const bool inside = parent_.slot != kNodeSlots;
    const NodeOperation first{};
    const NodeOperation& like = inside  ? node_.operation[parent_.slot]
                                : s > 0 ? node_.operation[s - 1]
                                        : first;
    number<8>(kRanks, o.ranks, 0, false);
    number<8>(kShift, o.shift, 0, false);
    uint32_t level = o.structure.level();
    number<10>(kLevel, level, like.structure.level() + inside, !inside);
    // Criteria do not grow downward.
    uint32_t error = 255u - o.error, radius = 0xffffu - o.radius;
    number<8>(kError, error, 255u - like.error, !inside);
    number<16>(kRadius, radius, 0xffffu - like.radius, !inside);
    o.error = uint8_t(255u - error);
    o.radius = uint16_t(0xffffu - radius);

    const auto kindOf = [&](int end) {
        const ChildCode code = o.structure.child(end);
        return isNoChild(code) ? 0u : 1 + code / kNodeSlots;
    };
    uint32_t kinds = o.isDummy() ? kindOf(0) : kindOf(0) | kindOf(1) << 2;
    number<8>(kKinds, kinds, 0, false);
    const ChildCode v = codeChild(s, 0, kinds & 3, level, next);
    const ChildCode u = o.isDummy() ? codeBefore(o.structure.child(1))
                                    : codeChild(s, 1, kinds >> 2 & 3, level, next);
    o.structure = StructureWord::of(v, u, level);
    codeDeltas(o);
    codeNormals(o, s);
    codeWords(s);
    if (has_boxes_) codeBox(o);
}

template <bool kDecode>
uint32_t NodeCoder<kDecode>::codeChild(uint32_t s, uint32_t end, uint32_t kind, uint32_t level,
                                       std::array<uint32_t, 3>& next) {
    if (kind == 0) return kNoChildCode;
    const uint32_t slot = next[kind - 1]++;
    if (kind == 1) {
        above_.push_back({s, end});
    } else {
        auto& levels = node_.reference_level[kind - 2];
        if (kDecode) levels.push_back(0);
        number<10>(kReferenceLevel, levels[slot], level + 1, false);
    }
    return std::min(slot, kNodeSlots - 1) + (kind - 1) * kNodeSlots;
}

template <bool kDecode>
uint32_t NodeCoder<kDecode>::codeBefore(ChildCode before) {
    if (parent_.slot != kNodeSlots) return parent_.slot;
    uint32_t code = isNoChild(before) ? 0 : before - kNodeSlots + 1;
    number<10>(kBefore, code, 0, false);
    return code == 0 ? kNoChildCode : kNodeSlots + std::min(code - 1, kNodeSlots - 1);
}

/// v and u go about as far, in opposite directions.
template <bool kDecode>
void NodeCoder<kDecode>::codeDeltas(NodeOperation& o) {
    for (size_t k = 0; k < 3; ++k) {
        auto v = uint8_t(o.delta[0][k]), u = uint8_t(o.delta[1][k]);
        number<8>(kDelta + k, u, 0, true);
        number<8>(kDelta + 3 + k, v, o.isDummy() ? 0 : 0u - u, true);
        o.delta[0][k] = int8_t(v);
        o.delta[1][k] = int8_t(u);
    }
}

/// The vertex before had about the mean of both.
template <bool kDecode>
void NodeCoder<kDecode>::codeNormals(NodeOperation& o, uint32_t s) {
    const bool inside = parent_.slot != kNodeSlots;
    for (const uint32_t byte : {0u, 8u}) {
        const auto at = [&](uint16_t n) { return uint32_t(n) >> byte & 255u; };
        const uint32_t before = inside  ? at(node_.operation[parent_.slot].normal[parent_.end])
                                : s > 0 ? at(node_.operation[s - 1].normal[0])
                                        : 0;
        uint32_t v = at(o.normal[0]), u = at(o.normal[1]);
        number<8>(kNormal + byte / 8, v, before, true);
        number<8>(kNormal + 2 + byte / 8, u, inside ? 2 * before - v : v, true);
        o.normal[0] = uint16_t((o.normal[0] & (0xff00u >> byte)) | v << byte);
        o.normal[1] = uint16_t((o.normal[1] & (0xff00u >> byte)) | u << byte);
    }
}

/// Colours as normals; scalars, floats of about the same size, by their bits.
template <bool kDecode>
void NodeCoder<kDecode>::codeWords(uint32_t s) {
    const size_t words = node_.layout.words();
    const bool inside = parent_.slot != kNodeSlots;
    uint32_t* const v = node_.word.data() + 2 * words * s;
    const uint32_t* const before =
        inside  ? node_.word.data() + words * (2 * size_t(parent_.slot) + parent_.end)
        : s > 0 ? v - 2 * words
                : nullptr;
    for (uint32_t byte = 0; byte < 4 * node_.layout.colours; ++byte) {
        const auto at = [&](uint32_t word) { return word >> (8 * byte) & 255u; };
        const uint32_t near = before ? at(before[0]) : 0;
        uint32_t of_v = at(v[0]), of_u = at(v[words]);
        number<8>(kWord + byte, of_v, near, true);
        number<8>(kWord + 4 + byte, of_u, inside ? 2 * near - of_v : of_v, true);
        if (!kDecode) continue;
        v[0] |= of_v << (8 * byte);
        v[words] |= of_u << (8 * byte);
    }
    for (size_t i = node_.layout.colours; i < words; ++i) {
        const size_t column = kWord + 8 * node_.layout.colours + 2 * (i - node_.layout.colours);
        whole(column, v[i], before ? before[i] : 0);
        whole(column + 1, v[words + i], v[i]);
    }
}

/// By how much it is smaller than the one above.
template <bool kDecode>
void NodeCoder<kDecode>::codeBox(NodeOperation& o) {
    const bool inside = parent_.slot != kNodeSlots;
    const NormalBox above = inside ? node_.operation[parent_.slot].normals : NormalBox();
    for (size_t k = 0; k < 3; ++k) {
        if constexpr (kDecode) {
            const uint32_t code = columns_.get(first_box_ + k);
            o.normals.set(k, above.low(k) + int32_t(code & 15),
                          above.high(k) - int32_t(code >> 4 & 15));
        } else {
            const auto low = uint32_t(o.normals.low(k) - above.low(k)) & 15;
            const auto high = uint32_t(above.high(k) - o.normals.high(k)) & 15;
            columns_.put(first_box_ + k, low | high << 4);
        }
    }
}

Columns& threadColumns(size_t count) {
    thread_local Columns columns;
    columns.begin(count);
    return columns;
}

}  // namespace

std::vector<std::byte> encodeNode(const OperationNode& node) {
    Columns& columns = threadColumns(columnCount(node.layout, kOperationsCodec));
    OperationNode copy = node;
    NodeCoder<false>(columns, copy, kOperationsCodec).run();
    std::vector<std::byte> bytes;
    bytes.reserve(24 * kNodeSlots);
    ByteWriter writer(bytes);
    writer.fixed(kOperationsCodec);
    writer.varint(node.operation.size());
    writer.varint(node.frontier);
    columns.write(writer);
    return bytes;
}

bool decodeNode(std::span<const std::byte> bytes, NodeIndex index, const NodeRow& row,
                WordLayout layout, OperationNode& node, std::string& fault) {
    ByteReader reader(bytes);
    const auto codec = reader.fixed<uint8_t>();
    if ((codec != kOperationsCodec && codec != kCodecWithoutNormals) || !reader.ok())
        return fault = "its codec is unknown", false;
    node.operation.assign(reader.varintUpTo(kNodeSlots), {});
    node.frontier = reader.varintUpTo(uint32_t(node.operation.size()));
    for (auto& levels : node.reference_level) levels.clear();
    node.layout = layout;
    node.word.assign(2 * layout.words() * node.operation.size(), 0);
    Columns& columns = threadColumns(columnCount(layout, codec));
    if (!columns.read(reader, 2 * kNodeSlots, fault)) return false;
    if (!NodeCoder<true>(columns, node, codec).run())
        return fault = "its columns are not those of a node", false;
    fault = faultOf(index, row, node);
    return fault.empty();
}

namespace {

/// Positions, normals, operations; corners; words.
constexpr size_t kBaseCorner = 5, kBaseWord = 8;

}  // namespace

std::vector<std::byte> encodeBase(const NodeForest& forest) {
    Columns columns;
    columns.begin(kBaseWord + forest.layout.words());
    Vec3i before{0, 0, 0};
    OperationId next = 0;
    for (size_t v = 0; v < forest.base_vertex.size(); ++v) {
        const Vertex& vertex = forest.base_vertex[v];
        for (int k = 0; k < 3; ++k)
            columns.put(size_t(k), zigzag(uint32_t(vertex.position()[k] - before[k])));
        before = vertex.position();
        columns.put(3, vertex.normal);
        const OperationId o = forest.base_operation[v];
        columns.put(4, o == kNoOperation ? 0 : 1 + zigzag(o - next));
        if (o != kNoOperation) next = o + 1;
    }
    for (size_t t = 0; t < forest.base_triangle.size(); ++t) {
        const Triangle& corner = forest.base_triangle[t];
        const bool closed = !forest.base_closed.empty() && forest.base_closed[t];
        columns.put(kBaseCorner, corner[0] << 1 | closed);
        for (size_t k = 1; k < 3; ++k) columns.put(kBaseCorner + k, corner[k]);
    }
    for (size_t i = 0; i < forest.base_word.size(); ++i)
        columns.put(kBaseWord + i % forest.layout.words(), forest.base_word[i]);
    std::vector<std::byte> bytes;
    ByteWriter writer(bytes);
    columns.write(writer);
    return bytes;
}

bool decodeBase(std::span<const std::byte> bytes, uint32_t format, NodeForest& forest,
                std::string& fault) {
    constexpr uint32_t kMost = 1u << 28;
    ByteReader reader(bytes);
    Columns columns;
    columns.begin(kBaseWord + forest.layout.words());
    if (!columns.read(reader, uint32_t(std::min<uint64_t>(kMost, 4096 * bytes.size())), fault))
        return false;
    const size_t vertices = columns.column[0].size(),
                 triangles = columns.column[kBaseCorner].size();
    for (size_t i = 0; i < columns.column.size(); ++i)
        if (columns.column[i].size() != (i >= kBaseCorner && i < kBaseWord ? triangles : vertices))
            return fault = "its columns have different lengths", false;
    forest.base_vertex.clear();
    forest.base_operation.clear();
    forest.base_triangle.clear();
    forest.base_closed.clear();
    forest.base_word.clear();
    std::vector<uint32_t> referred(forest.row.size(), 0);
    std::array<uint32_t, 3> position{};
    OperationId next = 0;
    for (size_t v = 0; v < vertices; ++v) {
        for (size_t k = 0; k < 3; ++k) position[k] += unzigzag(columns.get(k));
        const uint32_t normal = columns.get(3), code = columns.get(4);
        for (const uint32_t p : position)
            if (p > uint32_t(kLatticeMax)) return fault = "a vertex is off the lattice", false;
        forest.base_vertex.push_back(
            {int32_t(position[0]), int32_t(position[1]), int32_t(position[2]), normal & 0xffff});
        OperationId o = kNoOperation;
        if (code != 0) {
            o = next + unzigzag(code - 1);
            next = o + 1;
            const NodeIndex n = nodeOf(o);
            if (n >= forest.row.size() || forest.row[n].parent != kNoNode ||
                slotIn(o) != referred[n]++)
                return fault = fmt::format("vertex {} does not know its operation", v), false;
        }
        forest.base_operation.push_back(o);
        for (size_t i = 0; i < forest.layout.words(); ++i)
            forest.base_word.push_back(columns.get(kBaseWord + i));
    }
    for (size_t t = 0; t < triangles; ++t) {
        Triangle corners{columns.get(5), columns.get(6), columns.get(7)};
        if (format >= kFormatWithClosed) {
            forest.base_closed.push_back(corners[0] & 1);
            corners[0] >>= 1;
        }
        for (const uint32_t c : corners)
            if (c >= vertices) return fault = fmt::format("vertex {} is not there", c), false;
        forest.base_triangle.push_back(corners);
    }
    return true;
}

}  // namespace pietra::pmesh
