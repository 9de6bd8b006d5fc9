#pragma once
// What to do when no edge can be collapsed any more and cells are still above their quotas: dust,
// soups, foam, the debris of CAD. Slower (n log n a pass) and cruder, but it always gets there.
//
// Allocates as it needs. Works on faces, positions, flags, parents and cell counts of a
// WorkingMesh; fans and quadrics are stale afterwards.

#include <cstdint>
#include <vector>

#include "simplify/working_mesh.h"

namespace pietra {

class Fallback {
public:
    /// A cell may keep as many triangles above its quota as touch outer vertices: raises the
    /// quotas.
    void allowForLocks(WorkingMesh& mesh);

    /// Multiplies the quotas: what comes next is only for cells that are far above theirs.
    void relaxQuotas(WorkingMesh& mesh, float factor);

    /// Drops components, triangles that hang together over edges, that lie wholly in this mesh and
    /// have a box diagonal below `diameter`, smallest first, from cells above their quota; never
    /// the one of the largest diagonal. Returns the number of triangles dropped.
    uint32_t dropComponents(WorkingMesh& mesh, float diameter);

    /// Merges vertices of cells above their quota that lie in one box of a grid of spacing
    /// `spacing`, into one of them; repeats with a coarser grid until the quotas are met or one box
    /// holds all. Degenerate triangles go, and doubled ones in pairs, so that no edge is left with
    /// an odd number of triangles: no hole appears, but sheets may grow together. Outer vertices,
    /// those on borders and on non-manifold edges stay. Returns the number of vertices merged;
    /// `spacing` becomes that of the last grid.
    uint32_t clusterVertices(WorkingMesh& mesh, float& spacing);

private:
    struct EdgeUse {
        uint64_t key;     // both vertices, lower first
        uint32_t corner;  // where the edge starts
        bool operator<(const EdgeUse& o) const {
            return key != o.key ? key < o.key : corner < o.corner;
        }
    };
    struct Member {
        uint64_t box;
        uint32_t vertex;
        bool operator<(const Member& o) const {
            return box != o.box ? box < o.box : vertex < o.vertex;
        }
    };

    struct Component {
        float diagonal = 0;
        bool outer = false;  ///< an edge of it is used elsewhere too
        std::vector<uint32_t> faces;
    };

    std::vector<Component> findComponents(const WorkingMesh& mesh);
    void collectEdges(const WorkingMesh& mesh);
    void pinBorderTriangles(const WorkingMesh& mesh);
    bool mergeBoxes(WorkingMesh& mesh, float spacing, uint32_t& merged);
    void mergeMembers(const WorkingMesh& mesh, const Member* begin, const Member* end);
    uint32_t remapFaces(WorkingMesh& mesh);
    void dropDoubles(WorkingMesh& mesh);
    void classifyEdges(WorkingMesh& mesh);

    std::vector<EdgeUse> edges_;
    std::vector<uint64_t> shared_edges_;  // those used elsewhere too, sorted
    std::vector<uint8_t> pinned_face_;    // on such an edge: must survive
    std::vector<uint8_t> pinned_vertex_;  // may be merged into, must not be merged
    std::vector<uint8_t> active_;
    std::vector<Member> members_;
    std::vector<uint32_t> target_;
};

}  // namespace pietra
