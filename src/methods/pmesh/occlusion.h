#pragma once
// What the last picture hid (Derzapf et al. 2011, section 4.2; there by queries of nodes' boxes):
// spheres behind the farthest that shows where they would.
//
// Integers only, and monotone: a sphere within a hidden one is hidden. Its rectangle lies within
// the other's, so do the tiles that cover it, of a level no coarser, and its nearest point is no
// nearer: axes are no longer than one, and rounding is monotone.
//
// Of a point that shows, no sphere around is hidden. Outside of the picture nothing is.

#include <array>
#include <cstdint>
#include <vector>

#include "geometry/lattice.h"
#include "multires/seen_depth.h"

namespace pietra::pmesh {

class Occlusion {
public:
    Occlusion(const SeenDepth& seen, const Lattice& lattice);

    /// In steps; the centre's coordinates within +-2^24, the radius up to 2^24.
    bool hides(const Vec3i& centre, int64_t radius) const;

private:
    static constexpr int kAxisBits = 24, kTileBits = 8;
    /// For what is rounded: of the eye and of depths, steps; of the place of a tile, 1/256.
    static constexpr int64_t kMarginSteps = 2, kMarginTiles = 16;

    struct Level {
        int64_t columns, rows;
        std::vector<int32_t> farthest;  ///< steps
    };
    /// The tiles from one on to another, along one axis.
    struct Range {
        int64_t first, last;
    };
    Range tiles(const Vec3i& d, const Vec3i& axis, int64_t radius, int64_t near, int64_t far,
                int64_t middle) const;

    Vec3i eye_{0, 0, 0};
    Vec3i right_, down_, forward_;  // in units of 2^-kAxisBits, rounded towards zero
    int64_t tiles_a_slope_ = 0;     // 2^-kTileBits tiles for x/z = 1
    int64_t middle_x_ = 0, middle_y_ = 0;
    std::vector<Level> level_;  // each of half as many tiles as the one before; none: hides nothing
};

}  // namespace pietra::pmesh
