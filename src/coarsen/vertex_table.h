#pragma once
// The input's vertices on the lattice: a table of fixed-size records in temporary space, from which
// the corners of triangles are gathered. Two passes over the vertices (bounds, then records);
// memory O(batch). The order and the content depend on the input alone.

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <span>
#include <vector>

#include "base/progress.h"
#include "base/state.h"
#include "extmem/spill.h"
#include "geometry/bounds.h"
#include "geometry/lattice.h"
#include "geometry/mesh.h"
#include "io/triangle_source.h"

namespace pietra {

/// How one vertex is packed: an 8-byte lattice key, then, where the schema has them, the normal
/// (4 bytes), the colour (4) and the scalars (4 each). Keys are on the fine lattice.
struct VertexRecord {
    explicit VertexRecord(const AttributeSchema& schema)
        : normal_offset(8),
          colour_offset(normal_offset + (schema.normals_given ? 4 : 0)),
          scalar_offset(colour_offset + (schema.colours ? 4 : 0)),
          scalar_count(schema.scalars.size()),
          bytes(scalar_offset + 4 * scalar_count),
          normals(schema.normals_given),
          colours(schema.colours) {}
    size_t normal_offset, colour_offset, scalar_offset, scalar_count, bytes;
    bool normals, colours;

    static uint64_t key(const std::byte* record) {
        uint64_t key;
        std::memcpy(&key, record, sizeof key);
        return key;
    }
};

class VertexTable {
public:
    /// Reads all vertices of the source and chooses origin and fine step; the shift is 0 but for
    /// PrecisionSetting::kStep. Throws InputError (no vertices, span not representable), UsageError
    /// (a step too fine for 21 bits).
    VertexTable(TriangleSource& source, const std::string& input_name,
                const PrecisionSetting& precision, TempSpace& space, Progress& progress);

    /// Without records, from where save() was called.
    VertexTable(const AttributeSchema& schema, TempSpace& space, StateReader& state);
    void save(StateWriter& state) const;

    const VertexRecord& record() const { return record_; }
    const Lattice& lattice() const { return lattice_; }
    void setShift(int shift) { lattice_.shift = shift; }
    /// Bounds of all vertices, used or not, in lattice units.
    const Box3i& bounds() const { return bounds_; }
    uint64_t size() const { return count_; }
    /// The width of each scalar's range over all vertices, used or not; 0 where none is finite.
    const std::vector<float>& scalarRanges() const { return scalar_range_; }
    /// Upper bound of how far a vertex moved onto the lattice, in lattice units.
    float quantisationError() const;
    /// Frees the records.
    void clear() { records_.clear(); }

    /// For each triangle of `index`, three records in a row into `corners` (3 * record().bytes a
    /// triangle), keys snapped to the current shift. Gathers block by block: each part of the table
    /// that is needed is read once a call, whatever the order of the indices.
    void gather(std::span<const std::array<uint64_t, 3>> index, std::vector<std::byte>& corners,
                bool keys_only = false) const;

private:
    Box3d readBounds(TriangleSource& source, Progress& progress);
    void writeRecords(TriangleSource& source, Progress& progress);
    VertexRecord record_;
    Lattice lattice_;
    Box3i bounds_;
    uint64_t count_ = 0;
    std::vector<float> scalar_range_;
    Spill records_;
};

}  // namespace pietra
