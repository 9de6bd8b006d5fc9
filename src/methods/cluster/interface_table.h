#pragma once
// Interfaces out of core: the vertices that several leaves of the octree use, and the choice of
// those that leave them at a layer, from what the cells report (docs/design/cluster.md). Cells look
// at their own polygons only, one after the other or at once; what comes out depends on the input
// alone.
//
// A vertex is known by its Morton code; the table is in that order, so the vertices in a cell's
// cube are one range of it. Memory: 12 bytes a vertex and 4 a use, for the whole construction; some
// 20 a vertex and what can be removed of it for one layer; all from the budget.

#include <algorithm>
#include <array>
#include <cstdint>
#include <mutex>
#include <span>
#include <vector>

#include "base/budget.h"
#include "base/progress.h"
#include "coarsen/leaves.h"
#include "methods/cluster/octree.h"
#include "methods/cluster/polygon_mesh.h"

namespace pietra::cluster {

/// The different cells that use a vertex in a layer; of more than two, only that.
struct CellsAt {
    uint32_t count = 0;
    std::array<CellId, 2> cell{};  ///< increasing
};

class InterfaceTable {
public:
    /// Reads the leaves twice. Throws MemoryError.
    InterfaceTable(const Octree& octree, const Leaves& leaves, Budget& budget, Progress& progress);

    size_t size() const { return code_.size(); }
    /// kNone where no other leaf than the one in whose cube it lies uses the vertex.
    uint32_t find(const Vec3i& p) const;
    CellsAt cellsAt(uint32_t vertex, int layer) const;
    Vec3i positionOf(uint32_t vertex) const;

private:
    const Octree& octree_;
    Reservation memory_;
    std::vector<uint64_t> code_;
    std::vector<uint32_t> use_begin_;  // CSR over leaf_
    std::vector<uint32_t> leaf_;       // numbers
};

/// What leaves the interfaces from one layer to the next. First all cells report, then choose().
class Removals {
public:
    /// `layer`: the one above. Both must outlive this.
    Removals(const InterfaceTable& table, int layer, Budget& budget);

    /// The cell's polygons of the layer below. `joined`: pairs of vertices, by number, that an edge
    /// of the cell's input joins, sorted, the lower first. Thread-safe; each cell once.
    void report(CellId cell, const PolygonMesh& polygons,
                std::span<const std::array<uint32_t, 2>> joined);
    void choose();

    bool isRemoved(uint32_t vertex) const { return removed_[vertex] != 0; }
    size_t count() const { return list_.size(); }
    /// Of a removed vertex: its neighbours as they follow in the outline of the cell, one of two.
    std::array<uint32_t, 2> neighbours(uint32_t vertex, CellId cell) const;
    /// The other of the two.
    CellId otherCell(uint32_t vertex, CellId cell) const;

    /// What has left the cell's interfaces, in increasing order.
    std::vector<uint32_t> removedFrom(CellId cell) const;
    /// What the two cells of a removed vertex tell each other of its strip (StripsOfCell).
    /// Different ones at once.
    struct StripBounds {
        std::array<float, 2> by{};  ///< of its distance to layer 0, by what either has below
        float given = 0;            ///< of the distance of what was given to it
        float strip() const { return std::min(by[0], by[1]); }
    };
    StripBounds& boundsOf(uint32_t vertex);
    const StripBounds& boundsOf(uint32_t vertex) const {
        return const_cast<Removals*>(this)->boundsOf(vertex);
    }
    /// Which of the two the cell is: 0 or 1.
    size_t sideOf(uint32_t vertex, CellId cell) const {
        return table_.cellsAt(vertex, layer_).cell[1] == cell;
    }
    /// Once both have told: the one that is nearer to the strip gives it to the other.
    bool gives(uint32_t vertex, CellId cell) const {
        const StripBounds& bounds = boundsOf(vertex);
        return sideOf(vertex, cell) == size_t(bounds.by[0] >= bounds.by[1]);
    }

private:
    struct Outline {
        uint32_t before = kNone, after = kNone;
    };
    struct Candidate {
        double cost;
        uint32_t vertex;
        bool operator<(const Candidate& o) const {
            return cost < o.cost || (cost == o.cost && vertex < o.vertex);
        }
    };
    double costOf(uint32_t v, const Outline& outline) const;
    bool isRegular(uint32_t v) const;
    void pinLoops();
    std::vector<Candidate> candidates() const;

    const InterfaceTable& table_;
    const int layer_;
    Reservation memory_;
    std::vector<std::array<Outline, 2>> outline_;    // by the first of the cells, by the second
    std::vector<std::array<uint8_t, 2>> may_leave_;  // likewise
    std::vector<uint8_t> pinned_, removed_;
    std::mutex mutex_;
    std::vector<std::array<uint32_t, 2>> conflicts_;
    std::vector<uint32_t> list_;                              // what is removed, increasing
    std::vector<StripBounds> strip_bounds_;                   // one each
    std::vector<std::pair<CellId, uint32_t>> list_of_cells_;  // sorted
};

}  // namespace pietra::cluster
