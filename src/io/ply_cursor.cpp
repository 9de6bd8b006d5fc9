#include "io/ply_cursor.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/error.h"

namespace pietra {

namespace {

/// Longest padding after the last element.
constexpr size_t kMaxPadding = 4096;

/// Smallest and largest value of an integer type, as doubles (those of 64 bits rounded outward).
std::pair<double, double> rangeOf(PlyType type) {
    switch (type) {
        case PlyType::kInt8:
            return {-0x1p7, 0x1p7 - 1};
        case PlyType::kUint8:
            return {0, 0x1p8 - 1};
        case PlyType::kInt16:
            return {-0x1p15, 0x1p15 - 1};
        case PlyType::kUint16:
            return {0, 0x1p16 - 1};
        case PlyType::kInt32:
            return {-0x1p31, 0x1p31 - 1};
        case PlyType::kUint32:
            return {0, 0x1p32 - 1};
        case PlyType::kInt64:
            return {-0x1p63, 0x1p63};
        default:
            return {0, 0x1p64};
    }
}

}  // namespace

void PlyCursor::fail(const PlyPlace& place, const std::string& what) const {
    if (isAscii()) throw InputError::atLine(reader_.path(), place.line, what);
    throw InputError(reader_.path(), reader_.placeOf(place.offset), what);
}

void PlyCursor::failEnd() {
    if (!isAscii()) {
        if (!reader_.source().isCompressed()) reader_.seek(reader_.source().lengthBound());
        while (reader_.peek(1) > 0) reader_.advance(reader_.peek(1));
    }
    fail(fmt::format("the file ends within element {}, after {} of {} rows", element_->name, row_,
                     element_->count));
}

void PlyCursor::skipLineEnd() {
    if (p_ == end_) failEnd();
    p_ += p_[0] == '\r' && p_[1] == '\n' ? 2 : 1;
    ++line_;
}

void PlyCursor::endLine() {
    if (skipBlanks())
        fail(fmt::format("more values than element {} has properties", element_->name));
    if (p_ != end_) skipLineEnd();
}

void PlyCursor::findToken(const PlyProperty& property) {
    do {
        if (p_ == end_) failEnd();
        if (!lists_span_lines_)
            fail(fmt::format("the line ends where property {} of element {} is expected",
                             property.name, element_->name));
        skipLineEnd();
    } while (!skipBlanks());
}

void PlyCursor::skipToken(const PlyProperty& property) {
    if (!skipBlanks()) findToken(property);
    for (; !isBlankOrLineEnd(*p_) && (p_ != end_ || !at_end_); ++p_) need();
}

void PlyCursor::failNumber(const PlyProperty& property) const {
    fail(fmt::format("\"{}\" is no number (property {} of element {})", shownWord(p_),
                     property.name, element_->name));
}

double PlyCursor::takeReal(PlyType type) {
    if (type == PlyType::kFloat) return double(take<float>());
    if (type == PlyType::kDouble) return take<double>();
    if (type == PlyType::kUint64) return double(take<uint64_t>());
    return double(takeInteger(type));
}

int64_t PlyCursor::takeInteger(PlyType type) {
    switch (type) {
        case PlyType::kInt8:
            return take<int8_t>();
        case PlyType::kUint8:
            return take<uint8_t>();
        case PlyType::kInt16:
            return take<int16_t>();
        case PlyType::kUint16:
            return take<uint16_t>();
        case PlyType::kInt32:
            return take<int32_t>();
        case PlyType::kUint32:
            return take<uint32_t>();
        case PlyType::kInt64:
            return take<int64_t>();
        default:
            return int64_t(
                std::min<uint64_t>(take<uint64_t>(), std::numeric_limits<int64_t>::max()));
    }
}

double PlyCursor::wholeReal(double value, const PlyProperty& property) const {
    const auto [least, most] = rangeOf(property.type);
    if (!(value >= least && value <= most))
        fail(fmt::format("{} does not fit the type {} of property {} of element {}", value,
                         nameOf(property.type), property.name, element_->name));
    return std::trunc(value);
}

/// Some programs write whole numbers as "3.0" or "1e3".
const char* PlyCursor::integerAsReal(int64_t& value) const {
    double real = 0;
    const char* const after = parseReal(p_, end_, real);
    if (!after || !(std::abs(real) < 0x1p63) || real != std::trunc(real)) return nullptr;
    value = int64_t(real);
    return after;
}

uint64_t PlyCursor::nextCount(const PlyProperty& property) {
    const PlyPlace here = place();
    const int64_t count = nextInteger(property, property.count_type);
    if (count < 0)
        fail(here, fmt::format("a list of {} items (property {} of element {})", count,
                               property.name, element_->name));
    return uint64_t(count);
}

void PlyCursor::skipBytes(uint64_t bytes) {
    if (!reader_.source().isCompressed()) {
        if (bytes > reader_.source().lengthBound() - reader_.offset()) {
            reader_.seek(reader_.source().lengthBound());
            failEnd();
        }
        reader_.seek(reader_.offset() + bytes);
        return;
    }
    while (bytes > 0) {
        const size_t available = reader_.peek(1);
        if (available == 0) failEnd();
        const auto step = size_t(std::min<uint64_t>(available, bytes));
        reader_.advance(step);
        bytes -= step;
    }
}

void PlyCursor::skipValues(const PlyProperty& property, PlyType type, uint64_t count) {
    if (isAscii()) {
        for (; count > 0; --count) skipToken(property);
    } else if (count > std::numeric_limits<uint64_t>::max() / 16) {
        skipBytes(count);  // more than any file holds
    } else {
        skipBytes(count * sizeOf(type));
    }
}

void PlyCursor::skipProperty(const PlyProperty& property) {
    if (!property.is_list) return skipValues(property, property.type, 1);
    const uint64_t count = nextCount(property);
    skipValues(property, property.type, count);
}

void PlyCursor::skipTextRow() {
    beginRow();
    for (; p_ != end_ && *p_ != '\n' && *p_ != '\r'; ++p_) need();
    endRow();
}

void PlyCursor::skipRows(uint64_t count) {
    if (element_->properties.empty()) return;
    if (!isAscii() && !element_->hasLists()) {
        const uint64_t stride = element_->minimumRowBytes();
        if (count > std::numeric_limits<uint64_t>::max() / stride)
            fail(fmt::format("element {} counts more rows than a file can hold", element_->name));
        // note: only so that a file that ends here is reported with the right row.
        const uint64_t length = reader_.source().lengthBound();
        const uint64_t left = length - std::min(length, reader_.offset());
        if (!reader_.source().isCompressed() && left / stride < count) {
            row_ += left / stride;
            skipBytes(left + 1);
        }
        skipBytes(count * stride);
        row_ += count;
        return;
    }
    for (; count > 0; --count) {
        if (isAscii() && !lists_span_lines_) {
            skipTextRow();
            continue;
        }
        beginRow();
        for (const PlyProperty& property : element_->properties) skipProperty(property);
        endRow();
    }
}

void PlyCursor::expectEnd() {
    if (isAscii()) {
        while (!skipBlanks()) {
            if (p_ == end_) return;
            skipLineEnd();
        }
        fail("the file goes on after the last element that its header counts");
    }
    const size_t size = reader_.peek(kMaxPadding + 1);
    const uint8_t* data = reader_.data();
    const bool padding = size <= kMaxPadding && std::all_of(data, data + size, [](uint8_t byte) {
                             return byte == 0 || byte == ' ' || byte == '\n' || byte == '\r';
                         });
    if (!padding) fail("the file goes on after the last element that its header counts");
}

}  // namespace pietra
