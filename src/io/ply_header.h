#pragma once
// The header of a PLY file (Greg Turk's format, 1994): which elements follow, and how they are
// stored.
//
// Takes LF, CRLF and CR line ends, `comment` and `obj_info` lines, and the type names of both
// dialects (char, int8, ...), and int64/uint64 as an extension. Every fault is an InputError with
// its line.

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/byte_reader.h"

namespace pietra {

enum class PlyEncoding : uint8_t { kAscii, kLittleEndian, kBigEndian };

enum class PlyType : uint8_t {
    kInt8,
    kUint8,
    kInt16,
    kUint16,
    kInt32,
    kUint32,
    kInt64,
    kUint64,
    kFloat,
    kDouble
};

size_t sizeOf(PlyType type);
const char* nameOf(PlyType type);
inline bool isReal(PlyType type) {
    return type >= PlyType::kFloat;
}

struct PlyProperty {
    std::string name;
    PlyType type = PlyType::kFloat;  ///< of the value, or of each item of the list
    bool is_list = false;
    PlyType count_type = PlyType::kUint8;  ///< of a list's count: never kFloat or kDouble
};

struct PlyElement {
    std::string name;
    uint64_t count = 0;
    std::vector<PlyProperty> properties;

    bool hasLists() const;
    /// Bytes of a binary row; where there are lists, of a row whose lists are all empty.
    size_t minimumRowBytes() const;
    /// Position in `properties`, or empty.
    std::optional<size_t> find(const std::string& name) const;
};

struct PlyHeader {
    PlyEncoding encoding = PlyEncoding::kAscii;
    std::vector<PlyElement> elements;  ///< in the order of the file
    uint64_t body_offset = 0;          ///< of the first byte after the header
    uint64_t body_line = 0;            ///< its line, from 1
    bool names_textures = false;       ///< a comment does, as some programs have it

    const PlyElement* find(const std::string& name) const;
};

/// Longest header that is read; one without an end is not searched for further than this.
inline constexpr size_t kMaxPlyHeader = ByteReader::kWindow;

/// Parses the header at the start of `reader`.
PlyHeader readPlyHeader(ByteReader& reader);

}  // namespace pietra
