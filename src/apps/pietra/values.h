#pragma once
// The values of options as people write them: numbers, counts, picture sizes. A wrong one throws
// UsageError with what is wrong and an example of what is right; the caller puts the option's name
// before it. Nothing depends on the locale.

#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

#include "multires/view.h"

namespace pietra {

/// A closed range of numbers; `above` makes its lower end open.
struct NumberRange {
    double min = -std::numeric_limits<double>::infinity();
    double max = std::numeric_limits<double>::infinity();
    bool above = false;
};

/// A finite number: "0.5", "1e-3".
double parseNumber(std::string_view text, const NumberRange& range = {});

struct CountRange {
    uint64_t min = 0;
    uint64_t max = std::numeric_limits<uint64_t>::max() / 2;
};

/// A whole number, decimal multiples allowed: "1000", "64k", "2.5M", "1G".
uint64_t parseCount(std::string_view text, const CountRange& range = {});

/// Bytes, binary multiples allowed: "1000000", "512M", "1.5G".
uint64_t parseSize(std::string_view text);
/// The shortest text that parseSize() reads as so many bytes: "1G".
std::string formatSize(uint64_t bytes);

/// "1280x1024": width and height in pixels, each of 1 to kMaxPictureSide.
PictureSize parsePictureSize(std::string_view text);
inline constexpr int kMaxPictureSide = 16384;

}  // namespace pietra
