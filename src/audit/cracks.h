#pragma once
// Counts cracks and overlaps of a cut, exactly, on the integer lattice: no tolerance, no floats.
//
// Every edge is known by its two lattice points. How often the triangles of the cut must use it
// follows from its EdgeClass (geometry/mesh.h), the number of input triangles it stands for.
//
// Nearly all edges are complete within their patch. A vertex all of whose edges are complete is
// `settled` there; as long as no other patch has a vertex at that point, no other patch can use its
// edges. So only edges between unsettled vertices, and one 8-byte key a vertex, go into tables over
// the whole cut, an eighth of what all edges would take. Where two patches do share a settled
// vertex (components that touch in a point, or an overlap), the counts are lower bounds (`exact` is
// false), and a second counter must be told those vertices: countCracks() does so.
//
// Memory: the bytes given, whatever the size of the cut; more goes to temporary files
// (extmem/spill_table.h). The result does not depend on the order of the patches.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "audit/patch_stream.h"
#include "base/budget.h"
#include "geometry/mesh.h"

namespace pietra {

/// Lattice keys of an edge's ends, the smaller first.
using EdgeKey = std::array<uint64_t, 2>;

struct CrackReport {
    uint64_t triangles = 0;
    uint64_t edges = 0;         ///< different ones
    uint64_t border_edges = 0;  ///< kBorder and used once, as it should be
    // Faults:
    uint64_t cracked_edges = 0;      ///< used once and not kBorder
    uint64_t overlapping_edges = 0;  ///< used more than twice, nobody says kTriple or kMany
    uint64_t miscounted_edges = 0;   ///< kBorder used twice; kTriple or kMany used twice or more,
                                     ///< but not as often as it says
    uint64_t disagreeing_edges = 0;  ///< its users say different classes (counted beside the above)
    uint64_t degenerate_triangles = 0;   ///< two corners at one point; their edges are not counted
    std::optional<EdgeKey> first_fault;  ///< the least faulty edge, for a look at the place
    bool exact = true;                   ///< else the numbers of edges are too small
    bool ok() const {
        return exact && cracked_edges + overlapping_edges + miscounted_edges + disagreeing_edges +
                                degenerate_triangles ==
                            0;
    }
};

/// Told each correct border edge; called by several threads at once.
using BorderVisitor = std::function<void(const EdgeKey&)>;

/// Vertices whose edges must not be taken for complete within a patch.
struct SharedVertices {
    std::vector<uint64_t> keys;  ///< increasing
    bool all = false;            ///< too many to list: all are
    bool empty() const { return keys.empty() && !all; }
};

class CrackCounter {
public:
    /// Takes `memory_bytes` (2 MiB at least) of `budget`, which must outlive this; temporary files
    /// are unnamed and lie in `temp_dir`. `shared`: what a counter before found in the same cut.
    CrackCounter(Budget& budget, size_t memory_bytes, const std::string& temp_dir,
                 SharedVertices shared = {});
    ~CrackCounter();

    /// One patch of the cut; empty is fine. Thread-safe.
    void add(const Mesh& patch);
    /// After the last patch. `on_border` is not called if the result is not exact.
    CrackReport finish(const BorderVisitor& on_border = {});
    /// After finish(): settled in one patch and yet present in another; empty if exact.
    const SharedVertices& sharedVertices() const;

private:
    struct Tables;
    std::unique_ptr<Tables> tables_;
};

/// Counts over the cut `nodes`; reads it a second time where the first did not give exact numbers.
CrackReport countCracks(const PatchStream& stream, std::span<const NodeIndex> nodes, Budget& budget,
                        size_t memory_bytes, const std::string& temp_dir,
                        const BorderVisitor& on_border = {});

}  // namespace pietra
