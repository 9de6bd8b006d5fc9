#pragma once
// Exact Euclidean distance transform of a picture's pixels (Meijster, Roerdink, Hesselink 2000), in
// integers; linear in the number of pixels, parallel by columns and by rows.

#include <cstdint>
#include <vector>

#include "multires/view.h"

namespace pietra {

/// For each pixel (row-major) the squared distance of its centre to the centre of the nearest pixel
/// with mask != 0, or to the nearest centre just outside the picture, whichever is less: what lies
/// outside is unknown and might have been meant.
std::vector<int32_t> squaredDistances(const std::vector<uint8_t>& mask, const PictureSize& size);

}  // namespace pietra
