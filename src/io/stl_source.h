#pragma once
// STL files as a TriangleSource (stl_facets.h says what is taken). The format has no vertices:
// equal corners that lie near each other in the file are welded (vertex_window.h), also across
// solids. Memory: a window of 1 MiB, 2 MiB (text: 4 MiB) for each stream in use, and the caller's
// batch.

#include <memory>
#include <span>

#include "io/byte_reader.h"
#include "io/triangle_source.h"

namespace pietra {

/// Text files by content, binary ones, which have no magic bytes, by name.
bool isStl(std::span<const uint8_t> head, const std::string& name);

/// Throws InputError as openBinaryStl() does.
std::unique_ptr<TriangleSource> openStl(std::unique_ptr<ByteReader> reader);

}  // namespace pietra
