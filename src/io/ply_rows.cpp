#include "io/ply_rows.h"

#include <algorithm>

namespace pietra {

namespace {
constexpr size_t kScratchBytes = 1 << 18;
constexpr size_t kMostScratchRows = 4096;
}  // namespace

PlyRowReader::PlyRowReader(PlyCursor& cursor, const PlyElement& element)
    : cursor_(cursor), element_(element), in_place_(!cursor.isAscii() && !element.hasLists()) {
    for (const PlyProperty& p : element.properties) {
        const PlyType stored = cursor.isAscii() ? PlyType::kDouble : p.type;
        columns_.push_back({stride_, stored, p.type});
        if (!p.is_list) stride_ += sizeOf(stored);
    }
}

size_t PlyRowReader::next(size_t most) {
    if (!in_place_) return gather(most);
    ByteReader& reader = cursor_.reader();
    // note: whole rows only, and at least one; a window holds any row, since headers are bounded.
    if (reader.peek(stride_) < stride_) cursor_.failEnd();
    start_ = cursor_.place();
    data_ = reader.data();
    const size_t rows = std::min(most, reader.peek(stride_) / stride_);
    reader.advance(rows * stride_);
    cursor_.countRows(rows);
    return rows;
}

size_t PlyRowReader::gather(size_t most) {
    const size_t rows =
        std::min({most, kMostScratchRows, std::max<size_t>(kScratchBytes / stride_, 1)});
    scratch_.resize(rows * stride_);
    places_.clear();
    uint8_t* out = scratch_.data();
    for (size_t i = 0; i < rows; ++i) {
        cursor_.beginRow();
        places_.push_back(cursor_.place());
        for (const PlyProperty& p : element_.properties) {
            if (p.is_list) {
                cursor_.skipProperty(p);
            } else if (cursor_.isAscii()) {
                const double value = cursor_.nextReal(p);
                std::memcpy(out, &value, sizeof value);
                out += sizeof value;
            } else {
                cursor_.copyBytes(out, sizeOf(p.type));
                out += sizeOf(p.type);
            }
        }
        cursor_.endRow();
    }
    data_ = scratch_.data();
    return rows;
}

PlyPlace PlyRowReader::placeOf(size_t i) const {
    return in_place_ ? PlyPlace{start_.offset + i * stride_, 0} : places_[i];
}

}  // namespace pietra
