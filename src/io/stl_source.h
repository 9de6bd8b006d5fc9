#pragma once
// STL files as a TriangleSource (stl_facets.h says what is taken). The format has no vertices: each
// triangle brings three of its own, and welding is left to the lattice. (A table of the latest
// positions finds five of six corners again, but takes three times as long as reading, in each of
// five passes.) Triangles are numbers alone and need no reading. Memory: a window of 1 MiB, some
// KiB and the caller's batch.

#include <memory>

#include "io/byte_reader.h"
#include "io/file_signs.h"
#include "io/triangle_source.h"

namespace pietra {

/// Text files by content, binary ones, which have no magic bytes, by their size or name.
bool isStl(const FileSigns& signs);

/// Throws InputError as openBinaryStl() does.
std::unique_ptr<TriangleSource> openStl(std::unique_ptr<ByteReader> reader);

}  // namespace pietra
