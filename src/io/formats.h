#pragma once
// The table of mesh formats that Pietra reads. A new format is one reader and one line in
// formats.cpp.

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "io/byte_reader.h"
#include "io/file_signs.h"
#include "io/triangle_source.h"

namespace pietra {

struct MeshFormat {
    const char* name;  ///< as messages say it: "PLY"
    /// Whether a file is of this format. Rows above win.
    bool (*matches)(const FileSigns& signs);
    /// Opens it. Throws InputError where the header is bad.
    std::unique_ptr<TriangleSource> (*open)(std::unique_ptr<ByteReader> reader);
};

std::span<const MeshFormat> meshFormats();

}  // namespace pietra
