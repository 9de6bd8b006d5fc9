#pragma once
// Who wants to know of every collapse, and may forbid it: the recorder of progressive meshes.

#include <cstdint>
#include <span>

#include "simplify/attributes.h"
#include "simplify/collapse.h"
#include "simplify/working_mesh.h"

namespace pietra {

/// A collapse that all rules of the simplifier allow, about to be done: u goes, v moves to `to`.
struct CollapseStep {
    const WorkingMesh& mesh;  ///< as it is before
    uint32_t u, v;
    Vec3f to;                    ///< relative to mesh.centre
    float deviation;             ///< see Collapser::deviation()
    const Ring& ring;            ///< the triangles that remain, those of u first
    std::span<const Wing> wing;  ///< those that die
    const VertexAttributes& attributes;
};

class CollapseSink {
public:
    virtual ~CollapseSink() = default;
    /// Faces of a collapse that may soon be offered, to be brought into caches: told twice, the
    /// second time when what the first call asked for may have come.
    virtual void expect(uint32_t face, bool again) = 0;
    /// False forbids the collapse; true: it is done next.
    virtual bool take(const CollapseStep& step) = 0;
};

}  // namespace pietra
