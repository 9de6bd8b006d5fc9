#pragma once
// Where octree cells meet. A cell changes its layers without its neighbours, so their common
// outline must be the same for both at every layer, and where two layers meet, the gap be closed.
//
// From one layer to the next some vertices of interfaces are removed, no two of them in one face of
// either cell, and of those that a cell can do without not the eighth whose leaving costs most. For
// each, its two neighbours on the interface become joined, and one triangle, the *strip*, stands
// between old and new outline: drawn where one cell is finer than that step and the other is not,
// it closes the gap exactly. Strips of several steps compose.
//
// Never removed (pinned) are points where three cells meet, borders of the input, irregular
// vertices; three of each closed interface; the last vertex between two pinned ones; and any whose
// neighbours are joined in the input. In memory, for one piece.

#include <array>
#include <span>
#include <vector>

#include "methods/cluster/octree_cells.h"
#include "methods/cluster/polygon_mesh.h"

namespace pietra::cluster {

struct Strip {
    uint32_t removed;               ///< vertex of the model
    uint32_t before, after;         ///< its neighbours, as they follow in the first cell's outline
    std::array<uint32_t, 2> cells;  ///< the two that meet here
    uint16_t layer;                 ///< the first layer without it
};

class Interfaces {
public:
    /// `mesh` is the whole model.
    Interfaces(const Mesh& mesh, const CellTriangles& cells);

    std::span<const uint8_t> atInterface() const { return at_interface_; }
    std::span<const uint8_t> irregular() const { return irregular_; }
    uint32_t pinnedCount() const;

    /// Chooses the vertices that `layer` has no more, given the layer below of all cells. Their
    /// strips are added to strips().
    void removeFor(uint16_t layer, std::span<const PolygonMesh> cells);
    /// One a vertex of the model: removed by the last call.
    std::span<const uint8_t> justRemoved() const { return just_removed_; }
    const std::vector<Strip>& strips() const { return strips_; }

private:
    struct Candidate {
        double cost;
        uint32_t vertex;
        bool operator<(const Candidate& o) const {
            return cost < o.cost || (cost == o.cost && vertex < o.vertex);
        }
    };
    void findIrregular(const Mesh& mesh);
    void findInterfaces(const Mesh& mesh, std::span<const uint32_t> cell_of);
    void pinLoops();
    bool mayBeRemoved(uint32_t v) const;
    double costOf(uint32_t v) const;
    std::vector<Candidate> candidates(std::span<const PolygonMesh> cells,
                                      std::vector<std::array<uint32_t, 2>>& conflicts) const;
    void remove(uint32_t v);

    std::vector<Vec3i> position_;
    std::vector<uint8_t> irregular_, at_interface_, pinned_, just_removed_;
    std::vector<std::array<uint32_t, 2>>
        neighbour_;                                  // before and after in the first cell's outline
    std::vector<std::array<uint32_t, 2>> cells_at_;  // of what is not pinned: the cells that meet
    std::vector<uint64_t> joined_;  // pairs of vertices at interfaces that the input joins; sorted
    std::vector<Strip> strips_;
};

/// Of the vertices that a cell can do without, it keeps this part, whose leaving would cost most.
inline constexpr size_t kKeptPart = 8;

/// Whether the faces around an interface's vertex form a disc with a simple outline, which without
/// the vertex still has three corners. `fan`: the half-edges that begin there.
bool fanMayMerge(const PolygonMesh& mesh, std::span<const uint32_t> fan);

/// Faces of a cell that become one as vertices leave its interfaces.
Groups fansWithout(const PolygonMesh& cell, std::span<const uint8_t> removed);

}  // namespace pietra::cluster
