#pragma once
// Whether each patch is what its node says: counts, bounds, normal cone, and indices that exist.
//
// A patch with an index out of range is examined no further. Memory: nothing to speak of. The
// report does not depend on the order of the patches.

#include <cstdint>
#include <span>
#include <string>

#include "audit/patch_stream.h"
#include "multires/node.h"

namespace pietra {

struct PatchReport {
    uint64_t patches = 0;
    uint64_t triangles = 0;
    // Patches with a fault; one patch may have several.
    uint64_t malformed = 0;        ///< arrays of unequal length, or an index out of range
    uint64_t wrong_counts = 0;     ///< not as many triangles or vertices as the node says
    uint64_t outside_lattice = 0;  ///< a vertex that is not on the model's lattice
    uint64_t outside_bounds = 0;   ///< a vertex outside the node's bounds
    uint64_t outside_cone = 0;     ///< a triangle's normal outside the node's cone
    uint64_t falsely_closed = 0;   ///< the node says closed, but the patch has an edge that is not
    std::string first_fault;       ///< of the least node, one sentence; empty if there is none
    bool ok() const { return first_fault.empty(); }
};

/// Examines the patches of all nodes. `lattice`: of the model.
[[nodiscard]] PatchReport checkPatches(std::span<const Node> nodes, const Lattice& lattice,
                                       const AttributeSchema& schema, const PatchStream& stream);

}  // namespace pietra
