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

    /// Drops connected components without outer vertices and with a box diagonal below `diameter`,
    /// smallest first, from cells above their quota; never the one of the largest diagonal. Returns
    /// the number of triangles dropped.
    uint32_t dropComponents(WorkingMesh& mesh, float diameter);

    /// Merges vertices of cells above their quota that lie in one box of a grid of spacing
    /// `spacing`, into one of them; repeats with a coarser grid until the quotas are met or one box
    /// holds all. Degenerate and doubled triangles go; so do some where an edge would get more than
    /// three: it would be locked ever after. Edge classes become the number of uses. Outer vertices
    /// stay, and so do the triangles on the outer border. Returns the number of vertices merged;
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

    void collectEdges(const WorkingMesh& mesh);
    void pinBorderTriangles(const WorkingMesh& mesh);
    bool mergeBoxes(WorkingMesh& mesh, float spacing, uint32_t& merged);
    void mergeMembers(const WorkingMesh& mesh, const Member* begin, const Member* end);
    uint32_t remapFaces(WorkingMesh& mesh);
    void dropDoubles(WorkingMesh& mesh);
    void thinEdges(WorkingMesh& mesh);
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
