#pragma once
// A rendered picture, with the depth of every pixel, and its file: a PNG that any program shows.
//
// The depth travels in a private, ancillary chunk "piDZ" that other programs skip (and drop when
// they change the picture): version byte 1, three zero bytes, width and height (uint32), focal_px
// (double), all little-endian, then one zstd frame: the bits of the depths as uint32 (+inf as 0),
// each minus its left neighbour (the upper one in column 0), as four byte planes, low bytes first.

#include <string>
#include <vector>

#include "geometry/mesh.h"
#include "multires/view.h"

namespace pietra {

/// Row-major, row 0 on top.
struct Picture {
    PictureSize size{0, 0};
    std::vector<Rgba8> colour;  ///< sRGB, one a pixel
    /// View-space distance along the view axis in input units, +inf where nothing is; one a pixel,
    /// or empty where a picture read from a file has none.
    std::vector<float> depth;
    /// Pixels per unit of x/z; 0 where there is no depth.
    double focal_px = 0;

    size_t pixelCount() const { return size_t(size.width) * size_t(size.height); }
    bool hasDepth() const { return !depth.empty(); }
    size_t index(int x, int y) const { return size_t(y) * size_t(size.width) + size_t(x); }
};

/// Writes colour (without alpha) and depth, if any. Throws UsageError if `path` exists and `force`
/// is false, IoError if it cannot be written.
void writePng(const Picture& picture, const std::string& path, bool force);

/// Reads any PNG; depth where this program wrote it. Throws IoError, or InputError for a file that
/// is no PNG, is damaged, or has more than 2^28 pixels.
Picture readPicture(const std::string& path);

}  // namespace pietra
