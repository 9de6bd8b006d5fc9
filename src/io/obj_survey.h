#pragma once
// The first pass over an OBJ file: what it holds, how much of it, and where.
//
// A file says nothing beforehand: how many vertices there are, whether they have colours, and
// whether normals can be carried is known only at its end. This pass cuts the file into statements,
// looks at their first words, counts the corners of faces, and takes apart only what it must: the
// colours, and the faces of a file whose normals may match its vertices. It leaves a table of
// blocks, by which later passes leap over what does not concern them. The table has a largest size;
// a longer file has longer blocks.

#include <cstdint>
#include <string>
#include <vector>

#include "io/obj_cursor.h"

namespace pietra {

/// A run of statements, and what stands before it.
struct ObjBlock {
    ObjPlace start;
    uint64_t vertices = 0;
    uint64_t normals = 0;
    uint64_t faces = 0;
};

struct ObjSurvey {
    /// In the order of the file; one more at the end, which is empty, with the totals.
    std::vector<ObjBlock> blocks;
    uint64_t triangles = 0;     ///< about: exact but for comments and joined lines in faces
    bool colours = false;       ///< some vertex has a colour
    double colour_scale = 255;  ///< times a colour value is in [0, 255]
    bool normals =
        false;  ///< there are as many normals as vertices, and faces name the same of both
    std::vector<std::string> notes;  ///< what is left out

    uint64_t vertexCount() const { return blocks.back().vertices; }
    uint64_t faceCount() const { return blocks.back().faces; }
};

/// How long blocks are to be, at first.
inline constexpr uint64_t kObjBlockBytes = 1 << 18;

/// Reads the whole file. Throws InputError where a line is no statement, a colour or a face that it
/// looks into is faulty, or there is nothing to show.
ObjSurvey surveyObj(ByteReader& reader, uint64_t block_bytes);

/// The numbers of a `v` statement.
struct ObjVertex {
    double position[3] = {};
    double weight = 1;
    double colour[4] = {1, 1, 1, 1};  ///< red green blue alpha, as in the file
    int colour_values = 0;            ///< 0, 3 or 4
};

/// Reads what follows `v`, and moves past the statement.
void takeVertex(ObjCursor& cursor, ObjVertex& vertex);

}  // namespace pietra
