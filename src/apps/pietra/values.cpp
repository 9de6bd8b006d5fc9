#include "apps/pietra/values.h"

#include <fmt/format.h>

#include <charconv>
#include <cmath>

#include "base/error.h"
#include "base/text.h"

namespace pietra {

namespace {

/// The whole of `text` as a T; false on anything else.
template <class T>
bool parseWhole(std::string_view text, T& value) {
    const char* end = text.data() + text.size();
    const auto [rest, fault] = std::from_chars(text.data(), end, value);
    return fault == std::errc() && rest == end;
}

double countFactor(char unit) {
    switch (unit) {
        case 'k':
            return 1e3;
        case 'M':
            return 1e6;
        case 'G':
            return 1e9;
        default:
            return 0;
    }
}

}  // namespace

double parseNumber(std::string_view text, const NumberRange& range) {
    double value = 0;
    if (!parseWhole(text, value) || !std::isfinite(value))
        throw UsageError(fmt::format("'{}' is not a number", text));
    if (value < range.min || (range.above && value <= range.min))
        throw UsageError(fmt::format("'{}' must be {} {}", text,
                                     range.above ? "more than" : "at least", range.min));
    if (value > range.max)
        throw UsageError(fmt::format("'{}' must be at most {}", text, range.max));
    return value;
}

uint64_t parseCount(std::string_view text, const CountRange& range) {
    uint64_t count = 0;
    if (!parseWhole(text, count)) {
        const double factor = text.empty() ? 0 : countFactor(text.back());
        double value = 0;
        if (factor == 0 || !parseWhole(text.substr(0, text.size() - 1), value) || !(value >= 0) ||
            value * factor >= 0x1p63)
            throw UsageError(fmt::format("'{}' is not a count (such as 1000, 64k or 2.5M)", text));
        count = uint64_t(std::llround(value * factor));
    }
    if (count < range.min)
        throw UsageError(fmt::format("'{}' must be at least {}", text, range.min));
    if (count > range.max)
        throw UsageError(fmt::format("'{}' must be at most {}", text, range.max));
    return count;
}

uint64_t parseSize(std::string_view text) {
    const auto bytes = parseBytes(text);
    if (!bytes)
        throw UsageError(fmt::format("'{}' is not a size (such as 512M, 1.5G or 1000000)", text));
    return *bytes;
}

std::string formatSize(uint64_t bytes) {
    constexpr std::string_view kUnits = "kMGT";
    size_t units = 0;
    for (; units < kUnits.size() && bytes > 0 && bytes % 1024 == 0; ++units) bytes /= 1024;
    return fmt::format("{}{}", bytes, units > 0 ? kUnits.substr(units - 1, 1) : "");
}

PictureSize parsePictureSize(std::string_view text) {
    const size_t cross = text.find('x');
    PictureSize size;
    if (cross == text.npos || !parseWhole(text.substr(0, cross), size.width) ||
        !parseWhole(text.substr(cross + 1), size.height))
        throw UsageError(fmt::format("'{}' is not a picture size (such as 1280x1024)", text));
    if (size.width < 1 || size.height < 1 || size.width > kMaxPictureSide ||
        size.height > kMaxPictureSide)
        throw UsageError(
            fmt::format("'{}': width and height must be from 1 to {}", text, kMaxPictureSide));
    return size;
}

}  // namespace pietra
