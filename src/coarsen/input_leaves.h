#pragma once
// The front end of every construction out of core: vertices onto the lattice, triangles into
// buckets, buckets welded, leaf cells cut out of them (Cignoni et al. 2004, section 5.1).
//
// Stages of `progress`: kStages of them, begun here. Output depends on input, precision and leaf
// size alone. Memory: that of the plan, taken from the space's budget.

#include <algorithm>
#include <string>

#include "coarsen/leaves.h"
#include "coarsen/vertex_table.h"

namespace pietra {

/// How a memory limit is spent. What the libraries and the program itself take is set aside first;
/// of the rest, `work` is for the stages' own arrays, and temporary data may stay in memory as long
/// as that much remains free.
struct MemoryPlan {
    size_t budget, work;
    PartitionSettings partition;
    MemoryPlan(size_t limit, int jobs, size_t corner_bytes);
};

struct InputSettings {
    std::string input_name;  ///< for messages
    PrecisionSetting precision;
    uint32_t leaf_triangles = 4000;
    bool mark_irregular = false;  ///< LeafSettings::mark_irregular
    CellShape shape = CellShape::kTetrahedra;
};

class InputLeaves {
public:
    static constexpr int kStages = 6;
    /// Throws InputError where there is nothing to show, and what reading throws.
    InputLeaves(TriangleSource& source, const InputSettings& settings, const MemoryPlan& plan,
                TempSpace& space, Progress& progress);
    /// From where save() was called, for the same input and settings.
    InputLeaves(const AttributeSchema& schema, TempSpace& space, StateReader& state);
    /// Only where the space keeps what is saved.
    void save(StateWriter& state);

    VertexTable vertices;  ///< without its records
    uint64_t degenerate = 0;
    CellStore store;
    Leaves leaves;
    uint64_t inputTriangles() const { return leaves.triangles + leaves.duplicates + degenerate; }
};

}  // namespace pietra
