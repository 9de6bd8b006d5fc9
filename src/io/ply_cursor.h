#pragma once
// Reads the body of a PLY file value by value, binary or ascii, and words its faults.
//
// The general path of the PLY reader: lists, odd types, text. Rows of plain binary data are decoded
// in bulk elsewhere (ply_rows.h, ply_faces.h), straight from the ByteReader beneath. In ascii a row
// is one line; blank lines between rows are skipped; only the long lists of `tristrips` may go over
// several lines. Every fault is an InputError with the byte offset (binary) or the line (ascii).

#include <bit>
#include <cstdint>
#include <cstring>
#include <string>

#include "io/number_parser.h"
#include "io/ply_header.h"
#include "io/text_window.h"

namespace pietra {

/// A place in a PLY body. `line` counts in ascii only.
struct PlyPlace {
    uint64_t offset = 0;
    uint64_t line = 0;
};

/// Loads a value from unaligned bytes; `Swap` for the byte order that is not this machine's.
template <class T, bool Swap>
inline T loadValue(const uint8_t* p) {
    static_assert(std::endian::native == std::endian::little);
    if constexpr (!Swap || sizeof(T) == 1) {
        T value;
        std::memcpy(&value, p, sizeof value);
        return value;
    } else if constexpr (sizeof(T) == 2) {
        return std::bit_cast<T>(__builtin_bswap16(loadValue<uint16_t, false>(p)));
    } else if constexpr (sizeof(T) == 4) {
        return std::bit_cast<T>(__builtin_bswap32(loadValue<uint32_t, false>(p)));
    } else {
        return std::bit_cast<T>(__builtin_bswap64(loadValue<uint64_t, false>(p)));
    }
}

class PlyCursor : private TextWindow {
public:
    PlyCursor(ByteReader& reader, PlyEncoding encoding) : TextWindow(reader), encoding_(encoding) {}

    ByteReader& reader() { return reader_; }
    bool isAscii() const { return encoding_ == PlyEncoding::kAscii; }
    bool swapsBytes() const { return encoding_ == PlyEncoding::kBigEndian; }
    PlyPlace place() const { return {isAscii() ? offset() : reader_.offset(), line_}; }
    void seek(const PlyPlace& place) {
        if (!isAscii()) return reader_.seek(place.offset);
        TextWindow::seek(place.offset);
        line_ = place.line;
    }

    /// The rows that follow are those of `element` (kept by reference) from number `row` on.
    void beginRows(const PlyElement& element, uint64_t row) {
        element_ = &element;
        row_ = row;
        lists_span_lines_ = element.name == "tristrips";
    }
    void beginRow() {
        if (isAscii())
            while (!skipBlanks()) skipLineEnd();
    }
    void endRow() {
        ++row_;
        if (isAscii() && p_ != end_) endLine();
    }
    /// `count` rows were read past this cursor.
    void countRows(uint64_t count) { row_ += count; }
    uint64_t row() const { return row_; }

    /// The next value as a real number. In ascii it is rounded to the type of the property, and a
    /// whole number that does not fit it is a fault.
    double nextReal(const PlyProperty& property) {
        return isAscii() ? textReal(property) : takeReal(property.type);
    }
    /// The next value, or count or item of a list, as a whole number of `type`.
    int64_t nextInteger(const PlyProperty& property, PlyType type) {
        return isAscii() ? textInteger(property) : takeInteger(type);
    }
    /// The count of a list; not negative.
    uint64_t nextCount(const PlyProperty& property);
    /// The next bytes as they are (binary only).
    void copyBytes(void* out, size_t bytes) {
        std::memcpy(out, needBytes(bytes), bytes);
        reader_.advance(bytes);
    }
    /// Passes over the next `count` values of `type`.
    void skipValues(const PlyProperty& property, PlyType type, uint64_t count);
    void skipProperty(const PlyProperty& property);
    /// Passes over `count` rows of the element.
    void skipRows(uint64_t count);
    /// The file must end here, but for some padding.
    void expectEnd();

    [[noreturn]] void fail(const PlyPlace& place, const std::string& what) const;
    [[noreturn]] void fail(const std::string& what) const { fail(place(), what); }
    /// The file ends in the row at hand.
    [[noreturn]] void failEnd();

private:
    const uint8_t* needBytes(size_t bytes) {
        if (reader_.peek(bytes) < bytes) [[unlikely]]
            failEnd();
        return reader_.data();
    }
    template <class T>
    T take() {
        const uint8_t* p = needBytes(sizeof(T));
        const T value = swapsBytes() ? loadValue<T, true>(p) : loadValue<T, false>(p);
        reader_.advance(sizeof(T));
        return value;
    }
    double takeReal(PlyType type);
    int64_t takeInteger(PlyType type);
    void skipBytes(uint64_t bytes);
    void skipTextRow();

    static bool isBlank(char c) { return c == ' ' || c == '\t' || c == '\v' || c == '\f'; }
    bool endsToken(const char* p) const { return isBlankOrLineEnd(*p) || (p == end_ && at_end_); }
    /// Moves to the next character that is no blank; false at a line end or the end of the file.
    bool skipBlanks() {
        for (;; ++p_) {
            need();
            if (static_cast<unsigned char>(*p_) > ' ') return true;
            if (!isBlank(*p_)) return *p_ != '\n' && *p_ != '\r' && p_ != end_;
        }
    }
    void skipLineEnd();
    void endLine();
    double textReal(const PlyProperty& property) {
        if (!skipBlanks()) [[unlikely]]
            findToken(property);
        double value = 0;
        const char* const after = parseReal(p_, end_, value);
        takeToken(after, property);
        return property.type == PlyType::kFloat    ? double(float(value))
               : property.type == PlyType::kDouble ? value
                                                   : wholeReal(value, property);
    }
    int64_t textInteger(const PlyProperty& property) {
        if (!skipBlanks()) [[unlikely]]
            findToken(property);
        int64_t value = 0;
        const char* after = parseInteger(p_, value);
        if (!after || !endsToken(after)) [[unlikely]]
            after = integerAsReal(value);
        takeToken(after, property);
        return value;
    }
    /// Moves over the token at hand, which ends at `end`; null where it is no number.
    void takeToken(const char* end, const PlyProperty& property) {
        if (!end || !endsToken(end)) [[unlikely]]
            failNumber(property);
        p_ = end;
    }
    /// At a line end or the end of the file: moves to the next line's token, or throws.
    void findToken(const PlyProperty& property);
    const char* integerAsReal(int64_t& value) const;
    double wholeReal(double value, const PlyProperty& property) const;
    void skipToken(const PlyProperty& property);
    [[noreturn]] void failNumber(const PlyProperty& property) const;

    PlyEncoding encoding_;
    uint64_t line_ = 0;
    const PlyElement* element_ = nullptr;
    uint64_t row_ = 0;
    bool lists_span_lines_ = false;
};

}  // namespace pietra
