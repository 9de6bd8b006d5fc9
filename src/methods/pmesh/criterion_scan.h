#pragma once
// The criterion on many vertices at once. Floats only sort out what is certain; what is close is
// decided by Criterion itself, so the outcome is its own, whatever the machine.

#include <cstddef>
#include <cstdint>

#include "methods/pmesh/criterion.h"

namespace pietra::pmesh {

/// A bit a vertex.
struct ScanBits {
    uint64_t split = 0;  ///< needsSplit()
    uint64_t merge = 0;  ///< not needsLast()
};

/// Of `count` vertices, at most 64.
ScanBits scanVertices(const Criterion& criterion, const Vertex* vertex,
                      const VertexCriteria* criteria, size_t count);

}  // namespace pietra::pmesh
