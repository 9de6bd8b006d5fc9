#pragma once
// The table of mesh formats that Pietra reads. A new format is one reader and one line in
// formats.cpp.

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "io/byte_reader.h"
#include "io/triangle_source.h"

namespace pietra {

struct MeshFormat {
    const char* name;  ///< as messages say it: "PLY"
    /// Whether a file that begins with `head` (its first bytes, unpacked; whole if shorter than 4
    /// KiB) is of this format. `name` is its name in lower case, without ".gz" or the like. Rows
    /// above win.
    bool (*matches)(std::span<const uint8_t> head, const std::string& name);
    /// Opens it. Throws InputError where the header is bad.
    std::unique_ptr<TriangleSource> (*open)(std::unique_ptr<ByteReader> reader);
};

std::span<const MeshFormat> meshFormats();

}  // namespace pietra
