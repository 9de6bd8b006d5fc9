#pragma once
// One diamond of the hierarchy made coarser (Cignoni et al. 2004, section 5.2): the meshes of its
// cells' children are merged into one, simplified with the outer border locked, each cell to its
// own quota, bounded, and taken apart into cells again. Deterministic; one worker a thread.

#include <cstdint>
#include <span>
#include <vector>

#include "coarsen/cell_path.h"
#include "coarsen/cell_store.h"
#include "coarsen/edge_spread.h"
#include "coarsen/mesh_joiner.h"
#include "simplify/deviation.h"
#include "simplify/simplify.h"

namespace pietra {

/// Below this there is nothing to gain: cells of fewer triangles have no quota.
inline constexpr uint32_t kSmallestPatch = 128;

struct DiamondInput {
    /// For each split cell of the diamond, in path order: where its children's meshes lie (one or
    /// two).
    std::vector<std::vector<CellBlob>> children;
    std::vector<uint32_t> quota;  ///< one a cell: triangles to reach
    float child_error = 0;        ///< largest error stated by a child's diamond, lattice units
};

struct DiamondOutput {
    std::vector<CellMesh> cells;  ///< one a split cell, maybe without triangles
    float error = 0;              ///< proven bound of all cells, before saturation, lattice units
    uint64_t input_triangles = 0, output_triangles = 0, locked_vertices = 0, clustered = 0;
};

class DiamondWorker {
public:
    /// `scalar_range`: as in SimplifyInput, one a scalar.
    DiamondWorker(int shift, std::vector<float> scalar_range)
        : shift_(shift), scalar_range_(std::move(scalar_range)) {}
    /// Overwrites `output`, keeping its capacity.
    void run(const DiamondInput& input, DiamondOutput& output);

private:
    void merge(const DiamondInput& input);
    void addCell(const CellMesh& child, uint8_t label);
    void moveCrumbs(size_t cells);
    void takeApart(size_t cells, DiamondOutput& output);

    int shift_;
    std::vector<float> scalar_range_;
    Simplifier simplifier_;
    Deviation deviation_;
    MeshJoiner joiner_;
    EdgeSpread spread_;
    CellMesh child_, merged_;
    std::vector<uint8_t> label_;   // per merged triangle: its cell
    std::vector<uint8_t> closed_;  // per cell: what is merged into it is closed
    SimplifyOutput simplified_;
    FaceBounds bounds_;
    std::vector<uint32_t> local_;  // per simplified vertex: its number in the cell at hand
};

/// Triangles that a cell with `children_triangles` below it is to keep: half of them, or 63 % once
/// that comes below `patch_triangles` / 2, a size at which a surface's cells then stay from level
/// to level. The coarsest levels are few and go lower; a root keeps at most `patch_triangles` / 4.
uint32_t cellQuota(uint64_t children_triangles, uint32_t patch_triangles, int level);

}  // namespace pietra
