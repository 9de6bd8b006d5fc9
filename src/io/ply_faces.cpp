#include "io/ply_faces.h"

#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "base/error.h"

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
            schema_notes_.push_back(
                fmt::format("property {} of element {} is left out", p.name, element.name));
    }
    if (colours) schema_notes_.push_back("colours of faces are left out");

    if (list->type == PlyType::kUint32) restart_ = int64_t(0xffffffff);
    has_triangle_rows_ = !is_strips_ && !cursor.isAscii() && lists == 1 &&
                         sizeOf(list->count_type) == 1 && sizeOf(list->type) == 4;
    triangle_row_bytes_ = bytes_before_ + 1 + 12 + bytes_after;
    index_limit_ = std::min<uint64_t>(
        vertex_count, list->type == PlyType::kInt32 ? uint64_t(1) << 31 : uint64_t(1) << 32);
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

bool PlyFaceReader::read(TriangleBatch& batch) {
    readRows(batch.triangle);
    row_ = cursor_.row();
    return !rowsLeft();
}

void PlyFaceReader::readRows(Triangles& out) {
    while (out.size() < kMaxBatch) {
        if (!in_row_ && has_triangle_rows_) readTriangleRows(out);
        if (out.size() == kMaxBatch) break;
        if (!rowsLeft()) return;
        if (!in_row_) beginRow();
        readItems(out);
        if (list_left_ == 0) endRow();
    }
}

/// The fast path: stops at the first row that is not a triangle with good indices.
void PlyFaceReader::readTriangleRows(Triangles& out) {
    ByteReader& reader = cursor_.reader();
    while (out.size() < kMaxBatch) {
        const size_t whole = reader.peek(triangle_row_bytes_) / triangle_row_bytes_;
        const auto most = size_t(
            std::min<uint64_t>({whole, kMaxBatch - out.size(), element_.count - cursor_.row()}));
        if (most == 0) return;
        const size_t begin = out.size();
        out.resize(begin + most);
        const uint8_t* row = reader.data() + bytes_before_;
        const size_t done =
            cursor_.swapsBytes()
                ? decodeTriangles<true>(row, triangle_row_bytes_, most, index_limit_, &out[begin])
                : decodeTriangles<false>(row, triangle_row_bytes_, most, index_limit_, &out[begin]);
        out.resize(begin + done);
        reader.advance(done * triangle_row_bytes_);
        cursor_.countRows(done);
        if (done < most) return;
    }
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

void PlyFaceReader::readItems(Triangles& out) {
    const PlyProperty& list = element_.properties[list_property_];
    for (; list_left_ > 0 && out.size() < kMaxBatch; --list_left_) {
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

void PlyFaceReader::addFaceCorner(uint64_t index, Triangles& out) {
    if (corners_ >= 2) out.push_back({a_, b_, index});
    if (corners_ == 0) a_ = index;
    b_ = index;
    ++corners_;
}

void PlyFaceReader::addStripCorner(uint64_t index, Triangles& out) {
    if (corners_ >= 2 && a_ != b_ && a_ != index && b_ != index) {
        if (corners_ % 2 == 0)
            out.push_back({a_, b_, index});
        else
            out.push_back({b_, a_, index});
    }
    a_ = b_;
    b_ = index;
    ++corners_;
}

}  // namespace pietra
