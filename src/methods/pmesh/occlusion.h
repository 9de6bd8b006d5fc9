#pragma once
// What the last picture hid (Derzapf et al. 2011, section 4.2; there by queries of nodes' boxes):
// boxes behind the farthest that shows where they would.
//
// Monotone: a box within a hidden one is hidden. Its rectangle lies within the other's, so do the
// tiles that cover it, of a level no coarser, and its nearest point is no nearer; and sums,
// products and quotients that are monotone remain so when they are rounded.
//
// Of a point that shows, no box around is hidden. Outside of the picture nothing is.

#include <array>
#include <cstdint>
#include <vector>

#include "methods/pmesh/split_node.h"
#include "multires/seen_depth.h"

namespace pietra::pmesh {

class Occlusion {
public:
    Occlusion(const SeenDepth& seen, const Lattice& lattice, const SplitGrid& grid);

    /// As it is, or coarser by its error.
    bool hides(const NestedCriterion& c) const;

private:
    /// For what is rounded: of depths, steps; of the place of a tile, tiles.
    static constexpr double kMarginSteps = 2, kMarginTiles = 1.0 / 16;

    struct Level {
        int64_t columns, rows;
        std::vector<float> farthest;  ///< grid units
    };
    struct Range {
        double low, high;
    };
    /// Of the products of the box's points with an axis.
    Range along(const NestedCriterion& c, const Vec3d& axis) const;

    Vec3d eye_{0}, right_{0}, down_{0}, forward_{0};
    double tiles_a_slope_ = 0;  ///< for x/z = 1
    double middle_x_ = 0, middle_y_ = 0;
    std::vector<Level> level_;  // each of half as many tiles as the one before; none: hides nothing
};

}  // namespace pietra::pmesh
