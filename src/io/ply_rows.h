#pragma once
// Rows of a PLY element's scalar properties, as blocks of fixed stride: the first half of decoding
// vertices. The second half takes the blocks apart by column (ply_vertices.h).
//
// Binary rows without lists are handed out where they lie in the reader's window, without a copy.
// Other rows are gathered, without their lists, into a scratch block of at most some 256 KiB:
// binary values as they are, ascii ones as doubles of this machine.

#include <cstdint>
#include <vector>

#include "io/ply_cursor.h"

namespace pietra {

/// How one scalar property lies in the rows of a block.
struct PlyColumn {
    size_t offset = 0;
    PlyType stored = PlyType::kFloat;    ///< what the bytes are
    PlyType declared = PlyType::kFloat;  ///< what the header says
};

class PlyRowReader {
public:
    /// `element` must outlive this.
    PlyRowReader(PlyCursor& cursor, const PlyElement& element);

    /// Where property number `property`, which is no list, lies in the blocks.
    const PlyColumn& column(size_t property) const { return columns_[property]; }
    size_t stride() const { return stride_; }
    /// The bytes of blocks have the other byte order.
    bool swapsBytes() const { return cursor_.swapsBytes(); }

    /// Reads between 1 and `most` rows at the cursor, whose beginRows() was called; returns how
    /// many. The block lies at data() until the cursor moves on.
    size_t next(size_t most);
    const uint8_t* data() const { return data_; }
    /// Where row `i` of the block stands in the file.
    PlyPlace placeOf(size_t i) const;

private:
    size_t gather(size_t most);

    PlyCursor& cursor_;
    const PlyElement& element_;
    bool in_place_;
    size_t stride_ = 0;
    std::vector<PlyColumn> columns_;  ///< one a property; meaningless for lists
    const uint8_t* data_ = nullptr;
    PlyPlace start_;
    std::vector<uint8_t> scratch_;
    std::vector<PlyPlace> places_;  ///< of the rows in scratch_
};

}  // namespace pietra
