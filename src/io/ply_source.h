#pragma once
// PLY files as a TriangleSource (ply_header.h, ply_vertices.h and ply_faces.h say what is taken and
// how). Memory: a window of 1 MiB and the caller's batch. Elements may stand in any order; where
// rows have no fixed size (ascii, lists) the place of an element is found by reading what stands
// before it, once.

#include <memory>

#include "io/byte_reader.h"
#include "io/file_signs.h"
#include "io/triangle_source.h"

namespace pietra {

bool isPly(const FileSigns& signs);

/// Throws InputError where the header is bad, counts more than the file can hold, or has no
/// vertices or no faces.
std::unique_ptr<TriangleSource> openPly(std::unique_ptr<ByteReader> reader);

}  // namespace pietra
