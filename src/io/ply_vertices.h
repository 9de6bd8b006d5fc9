#pragma once
// The element `vertex` of a PLY file as vertex batches: which property means what, and the
// conversion by column.
//
// x y z are required. nx ny nz (all three) are the normal; red green blue [alpha], with or without
// "diffuse_" in front, or r g b [a], the colour: reals in [0, 1] and 16-bit values are
// scaled to [0, 255], other integers taken as they are. Texture coordinates (s t, u v, texture_u
// texture_v) and lists are left out, with a note; every other property is a scalar attribute of its
// name.

#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "io/ply_rows.h"
#include "io/triangle_source.h"

namespace pietra {

class PlyVertexReader {
public:
    /// `element` must outlive this. Throws InputError where it has no x, y and z.
    PlyVertexReader(PlyCursor& cursor, const PlyElement& element);

    const AttributeSchema& schema() const { return schema_; }
    const std::vector<std::string>& notes() const { return notes_; }

    /// Fills `batch` with the vertices from number `first` on, at the cursor, which is inside the
    /// element. There is at least one.
    void read(uint64_t first, VertexBatch& batch);

private:
    void chooseProperties();
    void append(size_t rows, VertexBatch& batch);
    void checkFinite(const VertexBatch& batch, size_t begin);

    PlyCursor& cursor_;
    const PlyElement& element_;
    PlyRowReader rows_;
    std::array<size_t, 3> position_{};
    std::optional<std::array<size_t, 3>> normal_;
    std::vector<size_t> colour_;  ///< red green blue [alpha], or empty
    std::vector<size_t> scalars_;
    AttributeSchema schema_;
    std::vector<std::string> notes_;
    size_t batch_rows_;
};

}  // namespace pietra
