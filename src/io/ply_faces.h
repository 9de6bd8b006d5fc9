#pragma once
// The elements `face` and `tristrips` of a PLY file as a stream of triangles.
//
// A face of more than three corners becomes a fan around its first one: the stream knows no
// positions, so a concave polygon may come out folded (a note counts the polygons). A face of fewer
// than three is left out, with a note. In strips -1 starts a new one, orientation alternates, and
// triangles with two equal indices, which only turn the strip, are left out. Every index is
// checked. Faces and strips of any length are streamed: nothing grows with them.

#include <cstdint>
#include <string>
#include <vector>

#include "io/ply_cursor.h"
#include "io/triangle_room.h"

namespace pietra {

class PlyFaceReader {
public:
    /// `element` must outlive this. Throws InputError where it has no list of vertex indices.
    PlyFaceReader(PlyCursor& cursor, const PlyElement& element, uint64_t vertex_count);

    /// Sentences about properties that are left out.
    const std::vector<std::string>& schemaNotes() const { return schema_notes_; }
    /// Sentences about what was met since start().
    std::vector<std::string> notes() const;

    /// Begins at the cursor, at the element's first row.
    void start();
    /// Rows read whole since start(); where reading goes on, the cursor's beginRows() must be told.
    uint64_t row() const { return row_; }
    /// Adds triangles until there is no room or the element ends. True where it has ended.
    bool read(TriangleRoom& out);

private:
    bool rowsLeft() const { return list_left_ > 0 || in_row_ || cursor_.row() < element_.count; }
    void readRows(TriangleRoom& out);
    void readPlainRows(TriangleRoom& out);
    size_t decodePolygons(const uint8_t* row, size_t bytes, TriangleRoom& out);
    void beginRow();
    void readItems(TriangleRoom& out);
    void endRow();
    void addFaceCorner(uint64_t index, TriangleRoom& out);
    void addStripCorner(uint64_t index, TriangleRoom& out);

    PlyCursor& cursor_;
    const PlyElement& element_;
    uint64_t vertex_count_;
    bool is_strips_;
    size_t list_property_ = 0;
    int64_t restart_ = -1;  ///< the index that starts a new strip, beside -1
    std::vector<std::string> schema_notes_;

    // Rows that are one list, with a count of 8 and indices of 32 bits, between fixed fields.
    bool has_plain_rows_ = false;
    size_t bytes_before_ = 0;
    size_t bytes_around_ = 0;  ///< all but the indices
    uint64_t index_limit_ = 0;
    uint64_t corner_limit_ = 0;

    uint64_t row_ = 0;
    // The state inside a row.
    bool in_row_ = false;
    uint64_t list_left_ = 0;
    uint64_t corners_ = 0;  ///< of this face, or of this strip since it began
    uint64_t a_ = 0, b_ = 0;

    uint64_t polygons_ = 0;
    uint64_t small_faces_ = 0;
};

}  // namespace pietra
