#include "store/node_block.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <unordered_map>

#include "base/check.h"
#include "store/columns.h"

namespace pietra {

namespace {

constexpr int kAxisBits = 8;  // a cone's axis, per octahedral component
constexpr int kCosineMax = 32767;

// Columns, in the order of the file.
enum Column : size_t {
    // one number a page
    kPageBytes,
    kPageNodes,
    kChecksumLow,
    kChecksumHigh,
    // one a node
    kFlags,
    kChild0,
    kChild1,
    kTriangles,
    kVertices,
    kGroupBack,
    kBounds,  // x, y, z, radius
    kConeAxis = kBounds + 4,
    kConeCosine,
    // one a node that does not share its group's values with one before it in the block
    kGroup,
    kSaturated,  // x, y, z, radius
    kError = kSaturated + 4,
    kFaceSize,  // only where nodes know it
    kColumns
};
constexpr size_t columnCount(bool face_sizes) {
    return face_sizes ? kColumns : kFaceSize;
}
constexpr size_t kFirstNodeColumn = kFlags;
constexpr size_t kFirstGroupColumn = kGroup;

constexpr uint32_t kHasChild[2] = {1, 2};
constexpr uint32_t kClosed = 4, kChildRange = 8, kJoint = 16;

struct ConeCode {
    uint32_t axis;
    uint32_t cosine;
};

Vec3f axisOf(uint32_t code) {
    const auto component = [](uint32_t byte) {
        return int16_t(restoreNormal(int32_t(byte & 255) - 128, kAxisBits));
    };
    return decodeNormal({component(code), component(code >> 8)});
}

ConeCode encodeCone(const NormalCone& cone) {
    const OctNormal oct = encodeNormal(cone.axis);
    const auto code = [](int16_t x) { return uint32_t(quantiseNormal(x, kAxisBits) + 128); };
    const uint32_t axis_code = code(oct.x) | code(oct.y) << 8;
    const Vec3d axis(cone.axis), stored(axisOf(axis_code));
    const double length = std::sqrt(glm::dot(axis, axis));
    const auto unknown = ConeCode{axis_code, 0};
    if (!(length > 0) || !(cone.cos_angle > -1)) return unknown;
    // The half-angle grows by the angle between the axes: the cosine of a sum of two angles.
    const Vec3d across = glm::cross(axis, stored);
    const double cos_turn = glm::dot(axis, stored) / length;
    const double sin_turn = std::sqrt(glm::dot(across, across)) / length;
    const double cos_cone = std::min(1.0, double(cone.cos_angle));
    const double sin_cone = std::sqrt(1 - cos_cone * cos_cone);
    if (sin_cone * cos_turn + cos_cone * sin_turn < 0) return unknown;  // beyond 180 degrees
    const double cosine = cos_cone * cos_turn - sin_cone * sin_turn;
    // One step lower covers all rounding above and that of whoever computes the dot product in
    // float.
    const double stored_cosine = std::floor(cosine * kCosineMax) - 1;
    return {axis_code, uint32_t(std::max(stored_cosine, -double(kCosineMax)) + kCosineMax)};
}

NormalCone decodeCone(const ConeCode& code) {
    return {axisOf(code.axis), float(int32_t(code.cosine) - kCosineMax) / float(kCosineMax)};
}

uint32_t bitsOf(float value) {
    return std::bit_cast<uint32_t>(value);
}

bool sameRefinement(const Node& a, const Node& b) {
    return a.group == b.group && bitsOf(a.error) == bitsOf(b.error) &&
           bitsOf(a.face_size) == bitsOf(b.face_size) &&
           bitsOf(a.saturated.radius) == bitsOf(b.saturated.radius) &&
           bitsOf(a.saturated.centre.x) == bitsOf(b.saturated.centre.x) &&
           bitsOf(a.saturated.centre.y) == bitsOf(b.saturated.centre.y) &&
           bitsOf(a.saturated.centre.z) == bitsOf(b.saturated.centre.z);
}

/// Values that differ little from the one before in the same column.
class DeltaWriter {
public:
    explicit DeltaWriter(std::array<std::vector<uint32_t>, kColumns>& columns)
        : columns_(columns) {}
    void put(size_t column, uint32_t value) {
        columns_[column].push_back(zigzag(value - before_[column]));
        before_[column] = value;
    }
    /// The values before, in so many columns.
    void repeat(size_t column, size_t count) {
        for (size_t k = 0; k < count; ++k) columns_[column + k].push_back(0);
    }
    void putSphere(size_t column, const Sphere& sphere) {
        for (int axis = 0; axis < 3; ++axis) put(column + axis, bitsOf(sphere.centre[axis]));
        put(column + 3, bitsOf(sphere.radius));
    }

private:
    std::array<std::vector<uint32_t>, kColumns>& columns_;
    std::array<uint32_t, kColumns> before_{};
};

class DeltaReader {
public:
    explicit DeltaReader(const std::array<std::vector<uint32_t>, kColumns>& columns)
        : columns_(columns) {}
    uint32_t get(size_t column, size_t row) {
        return before_[column] += unzigzag(columns_[column][row]);
    }
    float getFloat(size_t column, size_t row) {
        const auto value = std::bit_cast<float>(get(column, row));
        finite_ = finite_ && std::isfinite(value);
        return value;
    }
    Sphere getSphere(size_t column, size_t row) {
        Sphere sphere;
        for (int axis = 0; axis < 3; ++axis) sphere.centre[axis] = getFloat(column + axis, row);
        sphere.radius = getFloat(column + 3, row);
        return sphere;
    }
    bool allFinite() const { return finite_; }

private:
    const std::array<std::vector<uint32_t>, kColumns>& columns_;
    std::array<uint32_t, kColumns> before_{};
    bool finite_ = true;
};

/// Reads the columns, whose lengths only the block's counts and the column of group references
/// tell.
bool readColumns(std::span<const std::byte> bytes, const BlockEntry& entry, size_t column_count,
                 std::array<std::vector<uint32_t>, kColumns>& columns, std::string& fault) {
    ByteReader reader(bytes);
    const uint32_t group_rows = reader.varintUpTo(entry.node_count);
    std::array<uint8_t, kColumns> planes{};
    size_t streams = 0;
    for (size_t c = 0; c < column_count; ++c) {
        planes[c] = reader.fixed<uint8_t>();
        streams += std::min<size_t>(planes[c], 4);
    }
    if (!reader.ok() || std::ranges::any_of(planes, [](uint8_t count) { return count > 4; })) {
        fault = "its columns are damaged";
        return false;
    }
    const auto rows = [&](size_t column) {
        return column < kFirstNodeColumn    ? entry.page_count
               : column < kFirstGroupColumn ? entry.node_count
                                            : group_rows;
    };
    uint64_t total = 0;
    for (size_t c = 0; c < kColumns; ++c) total += uint64_t(planes[c]) * rows(c);
    StreamUnpacker unpacked;
    const uint32_t longest = std::max(entry.node_count, entry.page_count);
    if (!unpacked.read(reader, streams, longest, total, fault)) return false;
    size_t stream = 0;
    for (size_t c = 0; c < kColumns; ++c) {
        for (size_t k = 0; k < planes[c]; ++k)
            if (unpacked[stream + k].size() != rows(c)) {
                fault = "a column has the wrong length";
                return false;
            }
        columns[c].resize(rows(c));
        unpackColumn(unpacked, stream, planes[c], 0, columns[c]);
        stream += planes[c];
    }
    return true;
}

}  // namespace

NormalCone storedCone(const NormalCone& cone) {
    return decodeCone(encodeCone(cone));
}

std::vector<std::byte> encodeNodeBlock(std::span<const Node> nodes,
                                       std::span<const PageRecord> pages, bool face_sizes) {
    std::array<std::vector<uint32_t>, kColumns> columns;
    for (const PageRecord& page : pages) {
        columns[kPageBytes].push_back(page.bytes);
        columns[kPageNodes].push_back(page.node_count);
        columns[kChecksumLow].push_back(uint32_t(page.checksum));
        columns[kChecksumHigh].push_back(uint32_t(page.checksum >> 32));
    }
    DeltaWriter delta(columns);
    std::unordered_map<uint32_t, uint32_t> last_of_group;
    uint32_t expected_child = 0;
    for (uint32_t i = 0; i < nodes.size(); ++i) {
        const Node& node = nodes[i];
        uint32_t flags = (node.closed ? kClosed : 0) | (node.child_range ? kChildRange : 0) |
                         (node.is_joint ? kJoint : 0);
        for (int k = 0; k < 2; ++k) {
            const bool has = node.child[k] != kNoNode;
            if (has) flags |= kHasChild[k];
            columns[kChild0 + k].push_back(has ? zigzag(node.child[k] - expected_child) : 0);
            if (has) expected_child = node.child[k] + 1;
        }
        columns[kFlags].push_back(flags);
        columns[kTriangles].push_back(node.triangles);
        columns[kVertices].push_back(zigzag(node.vertices - node.triangles / 2));
        delta.putSphere(kBounds, node.bounds);
        const ConeCode cone = encodeCone(node.cone);
        columns[kConeAxis].push_back(cone.axis);
        columns[kConeCosine].push_back(cone.cosine);
        if (node.is_joint) {  // the group says the rest
            columns[kGroupBack].push_back(0);
            delta.put(kGroup, node.group);
            delta.repeat(kSaturated, kColumns - kSaturated);
            continue;
        }
        const auto last = last_of_group.find(node.group);
        const bool shared =
            last != last_of_group.end() && sameRefinement(node, nodes[last->second]);
        columns[kGroupBack].push_back(shared ? i - last->second : 0);
        last_of_group[node.group] = i;
        if (shared) continue;
        delta.put(kGroup, node.group);
        delta.putSphere(kSaturated, node.saturated);
        delta.put(kError, bitsOf(node.error));
        delta.put(kFaceSize, bitsOf(node.face_size));
    }
    std::vector<std::byte> bytes;
    ByteWriter writer(bytes);
    writer.varint(columns[kGroup].size());
    StreamPacker packer;
    std::vector<uint8_t> planes;
    for (size_t c = 0; c < columnCount(face_sizes); ++c) packColumn(columns[c], packer, planes);
    writer.raw(planes.data(), planes.size());
    packer.write(writer);
    return bytes;
}

bool decodeNodeBlock(std::span<const std::byte> bytes, const BlockEntry& entry, bool face_sizes,
                     std::vector<Node>& nodes, std::vector<PageRecord>& pages, std::string& fault) {
    std::array<std::vector<uint32_t>, kColumns> columns;
    if (!readColumns(bytes, entry, columnCount(face_sizes), columns, fault)) return false;
    uint64_t paged = 0;
    for (uint32_t p = 0; p < entry.page_count; ++p) {
        pages.push_back({columns[kChecksumLow][p] | uint64_t(columns[kChecksumHigh][p]) << 32,
                         columns[kPageBytes][p], columns[kPageNodes][p]});
        paged += columns[kPageNodes][p];
    }
    if (paged != entry.node_count) {
        fault = "its pages do not hold its nodes";
        return false;
    }
    DeltaReader delta(columns);
    const size_t first = nodes.size();
    const auto group_rows = uint32_t(columns[kGroup].size());
    uint32_t expected_child = 0, group_row = 0;
    for (uint32_t i = 0; i < entry.node_count; ++i) {
        Node node;
        const uint32_t flags = columns[kFlags][i];
        node.closed = (flags & kClosed) != 0;
        node.child_range = (flags & kChildRange) != 0;
        node.is_joint = (flags & kJoint) != 0;
        for (int k = 0; k < 2; ++k) {
            if ((flags & kHasChild[k]) == 0) continue;
            node.child[k] = expected_child + unzigzag(columns[kChild0 + k][i]);
            expected_child = node.child[k] + 1;
        }
        node.triangles = columns[kTriangles][i];
        node.vertices = unzigzag(columns[kVertices][i]) + node.triangles / 2;
        node.bounds = delta.getSphere(kBounds, i);
        node.cone = decodeCone({columns[kConeAxis][i], columns[kConeCosine][i] & 0xffff});
        const uint32_t back = columns[kGroupBack][i];
        if (back > i || (back == 0 && group_row == group_rows)) {
            fault = "its groups are damaged";
            return false;
        }
        if (back > 0) {
            const Node& mate = nodes[first + i - back];
            node.group = mate.group;
            node.saturated = mate.saturated;
            node.error = mate.error;
            node.face_size = mate.face_size;
        } else {
            node.group = delta.get(kGroup, group_row);
            node.saturated = delta.getSphere(kSaturated, group_row);
            node.error = delta.getFloat(kError, group_row);
            if (face_sizes) node.face_size = delta.getFloat(kFaceSize, group_row);
            ++group_row;
        }
        nodes.push_back(node);
    }
    if (!delta.allFinite()) {
        fault = "a node's numbers are not finite";
        return false;
    }
    return true;
}

}  // namespace pietra
