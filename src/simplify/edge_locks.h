#pragma once
// Which vertices may move: decided by how often each edge is used here, compared with how often its
// class says it is used in the whole model.

#include <cstdint>
#include <vector>

#include "simplify/working_mesh.h"

namespace pietra {

class VertexClassifier {
public:
    /// Sets rank and outer flag of every vertex; needs fans, faces and classes. Returns the number
    /// of outer vertices. Linear, but for vertices on curves with many corners (n log n in these).
    ///
    /// Outer (and so fixed): the ends of edges used not as often as their class says, of class
    /// kMany, or with triangles that disagree on the class. Curve: exactly two edges of class
    /// kBorder, or exactly two of kTriple, and none else but kManifold. Fixed: any other with such
    /// edges.
    uint32_t run(WorkingMesh& mesh);

private:
    struct EdgeUse {
        uint32_t neighbour;
        EdgeClass edge_class;
        bool operator<(const EdgeUse& o) const { return neighbour < o.neighbour; }
    };

    uint32_t flagsOf(const WorkingMesh& mesh, const Fan& fan);
    void collectUses(const WorkingMesh& mesh, const Fan& fan);

    std::vector<EdgeUse> uses_;
};

}  // namespace pietra
