#pragma once
// Interfaces out of core: the vertices that several leaves of the octree use, and the choice of
// those that leave them at a layer, from what the cells report (docs/design/cluster.md). Cells look
// at their own polygons only, one after the other or at once; what comes out depends on the input
// alone.
//
// A vertex is known by its Morton code; the table is in that order, so the vertices in a cell's
// cube are one range of it. Memory: 12 bytes a vertex and 4 a use, for the whole construction; some
// 20 a vertex and what can be removed of it for one layer; all from the budget.

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
    size_t count() const { return count_; }
    /// Of a removed vertex: its neighbours as they follow in the outline of the cell, one of two.
    std::array<uint32_t, 2> neighbours(uint32_t vertex, CellId cell) const;
    /// The other of the two.
    CellId otherCell(uint32_t vertex, CellId cell) const;

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
    size_t count_ = 0;
};

}  // namespace pietra::cluster
