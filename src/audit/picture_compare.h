#pragma once
// How much two pictures of the same view differ, in the terms of a pixel tolerance: what `compare`
// and "measured image error" mean. Neither picture is the reference: every distance is taken both
// ways.
//
// A pixel is covered where its depth is finite. Distances are between pixel centres, so they come
// in steps: a surface that moved by d pixels is found up to d + 1 away, and one thinner than a
// pixel may be missed by all samples of one picture. What lies outside the picture is unknown: no
// pixel is farther from anything than from the picture's border.
//
// - Coverage: pixels covered in one picture only, and how far the other's nearest covered pixel is.
// - Depth edges: a pixel that hides what lies behind its right, left, upper or lower neighbour. The
//   neighbour is not covered, or farther by more than `step` pixels (times depth / focal length),
//   also against both straight continuations of the surfaces, in 1 / depth, where these have two
//   pixels in line. Edges of one picture with a step over kStrongStep are sought among the steps of
//   the other over kWeakStep, continued or not, so that none is lost for lying at the limit.
// - Hairlines: slits between near surfaces, at most kHairline wide, through which one picture
//   shows something farther by a step over kWeakStep, and which the other shows closed. Parts that
//   touch without being joined may each move by the tolerance T, so slits up to 2 T wide open and
//   close though nothing has moved further; what was seen through one is hidden, not lost. They
//   are counted, and closed for the comparison of edges and depths. The reverse, something thin in
//   front of what is farther, is no hairline, however thin.
// - Depth: for each pixel covered in both how far its point lies from the other's surface, in
//   pixels (length * focal / depth). The surface is the points of the pixels in a window of
//   (2 kDepthRadius + 1)^2 and the triangles between neighbours that no weak edge separates; where
//   the window holds nothing nearer it is the difference along the ray. Left out are pixels at a
//   weak edge of either picture, on either side, where the surface turns away between two samples
//   (how those moved, the edges tell), and those within kDepthRadius of the border.
// - Shade: the largest difference of the three channels, over the pixels covered in both, or over
//   all pixels where a picture has no depth.
//
// The p99 is the least value that 99 % of the pixels concerned do not exceed. Linear in the number
// of pixels, uses all threads, and does not depend on how many there are.

#include <cstdint>

#include "render/picture.h"

namespace pietra {

inline constexpr float kWeakStep = 4;    ///< pixels
inline constexpr float kStrongStep = 8;  ///< pixels
inline constexpr int kDepthRadius = 2;   ///< pixels
inline constexpr int kHairline = 1;      ///< pixels

/// Mean, 99th percentile and maximum over `count` pixels; all 0 where there are none.
struct Spread {
    uint64_t count = 0;
    double mean = 0, p99 = 0, max = 0;
};

struct PictureDifference {
    bool has_depth = false;  ///< both pictures have depth; else only `shade` is set
    uint64_t pixels = 0;
    uint64_t covered_a = 0, covered_b = 0;
    uint64_t only_a = 0, only_b = 0;          ///< covered in one picture
    uint64_t hairline_a = 0, hairline_b = 0;  ///< open in one picture
    Spread coverage_px;                       ///< of these, distance to the other's coverage
    Spread edge_px;   ///< of strong edges, distance to the other's weak edges
    Spread depth_px;  ///< of pixels covered in both, away from edges, both ways
    Spread shade;     ///< of 255
    /// The largest of the three distances.
    double largestPx() const;
};

/// `supersampled`: this many pixels of these pictures along each side of the pixels that count, for
/// distances and steps. With a tolerance of T such pixels, what moves by T to and fro changes a
/// step by 2 T: edges are comparable up to T = (kStrongStep - kWeakStep) / 2. Throws UsageError if
/// the sizes differ, or the focal lengths by more than a millionth.
PictureDifference compare(const Picture& a, const Picture& b, int supersampled = 1);

}  // namespace pietra
