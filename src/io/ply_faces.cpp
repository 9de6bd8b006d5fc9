#include "io/ply_faces.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"
#include "io/notes.h"

namespace pietra {

namespace {

/// Decodes rows of three 32-bit indices until one is something else or `most` are done; returns how
/// many. `row` points at the count of the first list.
template <bool Swap>
size_t decodeTriangles(const uint8_t* row, size_t stride, size_t most, uint64_t index_limit,
                       std::array<uint64_t, 3>* out) {
    for (size_t i = 0; i < most; ++i, row += stride) {
        const uint32_t a = loadValue<uint32_t, Swap>(row + 1);
        const uint32_t b = loadValue<uint32_t, Swap>(row + 5);
        const uint32_t c = loadValue<uint32_t, Swap>(row + 9);
        if ((row[0] != 3) | (a >= index_limit) | (b >= index_limit) | (c >= index_limit)) return i;
        out[i] = {a, b, c};
    }
    return most;
}

bool isIndexList(const PlyProperty& p) {
    return p.is_list && (p.name == "vertex_indices" || p.name == "vertex_index");
}

}  // namespace

PlyFaceReader::PlyFaceReader(PlyCursor& cursor, const PlyElement& element, uint64_t vertex_count)
    : cursor_(cursor),
      element_(element),
      vertex_count_(vertex_count),
      is_strips_(element.name == "tristrips") {
    const auto& properties = element.properties;
    const auto list = std::find_if(properties.begin(), properties.end(), isIndexList);
    const std::string& path = cursor.reader().path();
    if (list == properties.end())
        throw InputError(path, "",
                         fmt::format("element {} has no list vertex_indices", element.name));
    if (isReal(list->type))
        throw InputError(
            path, "",
            fmt::format("the vertex indices of element {} are real numbers", element.name));
    list_property_ = size_t(list - properties.begin());
    bool colours = false;
    std::vector<std::string> others;
    size_t lists = 0, bytes_after = 0;
    for (size_t i = 0; i < properties.size(); ++i) {
        const PlyProperty& p = properties[i];
        if (p.is_list)
            ++lists;
        else
            (i < list_property_ ? bytes_before_ : bytes_after) += sizeOf(p.type);
        if (i == list_property_) continue;
        if (p.name == "red" || p.name == "green" || p.name == "blue" || p.name == "alpha")
            colours = true;
        else
            others.push_back(p.name + " of element " + element.name);
    }
    if (!others.empty()) schema_notes_.push_back(leftOut("property", others));
    if (colours) schema_notes_.push_back("colours of faces are left out");

    if (list->type == PlyType::kUint32) restart_ = int64_t(0xffffffff);
    has_plain_rows_ = !is_strips_ && !cursor.isAscii() && lists == 1 &&
                      sizeOf(list->count_type) == 1 && sizeOf(list->type) == 4;
    bytes_around_ = bytes_before_ + 1 + bytes_after;
    index_limit_ = std::min<uint64_t>(
        vertex_count, list->type == PlyType::kInt32 ? uint64_t(1) << 31 : uint64_t(1) << 32);
    corner_limit_ =
        std::min<uint64_t>(vertex_count, list->count_type == PlyType::kInt8 ? 127 : 255);
}

void PlyFaceReader::start() {
    cursor_.beginRows(element_, 0);
    in_row_ = false;
    row_ = list_left_ = polygons_ = small_faces_ = 0;
}

std::vector<std::string> PlyFaceReader::notes() const {
    std::vector<std::string> notes;
    if (polygons_ > 0)
        notes.push_back(fmt::format("{} polygons are cut into fans of triangles", polygons_));
    if (small_faces_ > 0)
        notes.push_back(
            fmt::format("{} faces of fewer than three corners are left out", small_faces_));
    return notes;
}

bool PlyFaceReader::read(TriangleRoom& out) {
    readRows(out);
    row_ = cursor_.row();
    return !rowsLeft();
}

void PlyFaceReader::readRows(TriangleRoom& out) {
    while (out.left() > 0) {
        if (!in_row_ && has_plain_rows_) readPlainRows(out);
        if (out.left() == 0 || !rowsLeft()) return;
        if (!in_row_) beginRow();
        readItems(out);
        if (list_left_ == 0) endRow();
    }
}

/// The fast path: stops at the first row that is faulty or does not fit the window or the room, for
/// the general path to take it.
void PlyFaceReader::readPlainRows(TriangleRoom& out) {
    ByteReader& reader = cursor_.reader();
    const size_t triangle_bytes = bytes_around_ + 12;
    while (out.left() > 0 && cursor_.row() < element_.count) {
        const size_t available = reader.peek(triangle_bytes);
        if (available < triangle_bytes) return;
        const uint8_t* row = reader.data() + bytes_before_;
        if (*row != 3) {
            const size_t done = decodePolygons(row, available - bytes_before_, out);
            if (done == 0) return;
            reader.advance(done);
            continue;
        }
        const auto most = size_t(std::min<uint64_t>(
            {available / triangle_bytes, out.left(), element_.count - cursor_.row()}));
        std::array<uint64_t, 3>* to = out.data + out.size;
        const size_t done =
            cursor_.swapsBytes()
                ? decodeTriangles<true>(row, triangle_bytes, most, index_limit_, to)
                : decodeTriangles<false>(row, triangle_bytes, most, index_limit_, to);
        out.size += done;
        reader.advance(done * triangle_bytes);
        cursor_.countRows(done);
        if (done == 0) return;
    }
}

/// Decodes rows of four or more indices; `row` points at the count of the first one, and `bytes`
/// follow. Returns how many bytes were taken.
size_t PlyFaceReader::decodePolygons(const uint8_t* row, size_t bytes, TriangleRoom& out) {
    const auto index = [&](const uint8_t* at) {
        return cursor_.swapsBytes() ? loadValue<uint32_t, true>(at)
                                    : loadValue<uint32_t, false>(at);
    };
    const uint64_t rows_left = element_.count - cursor_.row();
    const size_t bytes_after = bytes_around_ - bytes_before_ - 1;
    size_t taken = 0;
    uint64_t rows = 0;
    for (; rows < rows_left && taken < bytes; ++rows) {
        const size_t corners = row[taken];
        // note: the next row's first fields may lie beyond `bytes`, its count must not.
        const size_t row_bytes = 1 + 4 * corners + bytes_after;
        if (corners < 4 || corners > corner_limit_ || corners - 2 > out.left() ||
            row_bytes > bytes - taken)
            break;
        const uint8_t* items = row + taken + 1;
        uint64_t first = index(items), previous = index(items + 4);
        uint64_t largest = std::max(first, previous);
        for (size_t k = 2; k < corners; ++k) {
            const uint64_t next = index(items + 4 * k);
            largest = std::max(largest, next);
            out.add(first, previous, next);
            previous = next;
        }
        if (largest >= index_limit_) {
            out.size -= corners - 2;
            break;
        }
        taken += row_bytes + bytes_before_;
    }
    polygons_ += rows;
    cursor_.countRows(rows);
    return taken;
}

void PlyFaceReader::beginRow() {
    cursor_.beginRow();
    in_row_ = true;
    for (size_t i = 0; i < list_property_; ++i) cursor_.skipProperty(element_.properties[i]);
    const PlyPlace here = cursor_.place();
    list_left_ = cursor_.nextCount(element_.properties[list_property_]);
    corners_ = 0;
    if (is_strips_) return;
    if (list_left_ > 3) {
        // note: a real polygon repeats no vertex; without this a damaged count would be taken for
        // one.
        if (list_left_ > vertex_count_)
            cursor_.fail(here, fmt::format("a face of {} corners in a mesh of {} vertices",
                                           list_left_, vertex_count_));
        ++polygons_;
    }
    if (list_left_ < 3) ++small_faces_;
}

void PlyFaceReader::readItems(TriangleRoom& out) {
    const PlyProperty& list = element_.properties[list_property_];
    for (; list_left_ > 0 && out.left() > 0; --list_left_) {
        const PlyPlace here = cursor_.place();
        const int64_t index = cursor_.nextInteger(list, list.type);
        if (is_strips_ && (index == -1 || index == restart_)) {
            corners_ = 0;
            continue;
        }
        if (uint64_t(index) >= vertex_count_) [[unlikely]]
            cursor_.fail(here, fmt::format("vertex index {} in a mesh of {} vertices", index,
                                           vertex_count_));
        if (is_strips_)
            addStripCorner(uint64_t(index), out);
        else
            addFaceCorner(uint64_t(index), out);
    }
}

void PlyFaceReader::endRow() {
    for (size_t i = list_property_ + 1; i < element_.properties.size(); ++i)
        cursor_.skipProperty(element_.properties[i]);
    cursor_.endRow();
    in_row_ = false;
}

void PlyFaceReader::addFaceCorner(uint64_t index, TriangleRoom& out) {
    if (corners_ >= 2) out.add(a_, b_, index);
    if (corners_ == 0) a_ = index;
    b_ = index;
    ++corners_;
}

void PlyFaceReader::addStripCorner(uint64_t index, TriangleRoom& out) {
    if (corners_ >= 2 && a_ != b_ && a_ != index && b_ != index) {
        if (corners_ % 2 == 0)
            out.add(a_, b_, index);
        else
            out.add(b_, a_, index);
    }
    a_ = b_;
    b_ = index;
    ++corners_;
}

}  // namespace pietra
