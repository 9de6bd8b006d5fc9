#pragma once
// Wavefront OBJ files as a TriangleSource.
//
// Taken: `v x y z`, with a weight (`w`, left out) or a colour (`r g b` or `r g b a`: in [0, 1], or
// in [0, 255] where some value of the file is above 2; vertices without one are white); faces of
// any number of corners `v`, `v/vt`, `v//vn`, `v/vt/vn`, counted from the start or, negative, from
// what comes before. A face of more than three corners becomes a fan around its first one: the
// stream knows no positions, so a concave polygon may come out folded (a note counts the polygons).
// Texture coordinates, materials, lines, points and free-form surfaces are left out with a note;
// groups and smoothing mean nothing here. obj_cursor.h says how statements are cut.
//
// The vertices of the source are the `v` statements, in their order. OBJ gives normals to corners,
// not to vertices, and to carry those would take memory for every vertex. So normals are carried
// where they are one to one with the vertices (as many `vn` as `v`, every corner of every face
// names the same of both: what most scanners and Pietra itself write), else left out with a note.
//
// Indices of vertices are checked against the whole file, those of texture coordinates and of
// normals that are left out only for being numbers.
//
// Opening reads the file once (obj_survey.h). Reading the vertices, or the triangles, then leaps
// over the blocks of the file without any. Memory: a window of 1 MiB, another one where normals are
// carried, the table of blocks (some 200 KiB at most) and the caller's batch, whatever the size of
// the file, of its lines or of its faces.

#include <memory>

#include "io/byte_reader.h"
#include "io/file_signs.h"
#include "io/triangle_source.h"

namespace pietra {

/// By the name, or by whole lines that are all statements of the format.
bool isObj(const FileSigns& signs);

/// Throws InputError where the file holds what is no statement, or has no vertices or no faces.
std::unique_ptr<TriangleSource> openObj(std::unique_ptr<ByteReader> reader);

/// The same with blocks of another size, for tests; what is read does not depend on it.
std::unique_ptr<TriangleSource> openObjInBlocks(std::unique_ptr<ByteReader> reader,
                                                uint64_t block_bytes);

}  // namespace pietra
