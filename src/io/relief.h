#pragma once
// A planet's relief as a closed mesh, from a netCDF grid of heights over longitude and latitude,
// such as ETOPO5 of the Debian package ferret-datasets (NGDC, public domain): 4320 x 2161 heights
// make 18,653,760 triangles.

#include <cstdint>
#include <memory>
#include <string>

#include "io/synthetic_mesh.h"

namespace pietra {

struct ReliefSettings {
    double radius_km = 6371;
    double exaggeration = 20;  ///< heights are drawn so many times larger
    /// About as many triangles: every s-th sample both ways, s a divisor of the grid. 0: all
    /// samples.
    uint64_t triangles = 0;
};

/// Where Debian's ferret-datasets puts ETOPO5.
inline constexpr const char* kEtopo5Path = "/usr/share/ferret-vis/data/etopo5.cdf";

/// The largest variable of `path` over latitude (both poles, either way) and longitude (all around,
/// without a repeated column), in metres. Positions are in km around the centre, z to the north
/// pole; one vertex a pole and no seam; outward orientation; colours by height and the scalar
/// `height_m`. Reads the whole grid: four bytes a sample. Throws InputError, IoError.
std::unique_ptr<const SyntheticMesh> makeRelief(const std::string& path,
                                                const ReliefSettings& settings);

}  // namespace pietra
