#include "base/text.h"

#include <charconv>
#include <cmath>

namespace pietra {

std::optional<uint64_t> parseBytes(std::string_view text) {
    double value = 0;
    const char* end = text.data() + text.size();
    const auto [rest, fault] = std::from_chars(text.data(), end, value, std::chars_format::fixed);
    if (fault != std::errc() || !(value >= 0)) return std::nullopt;
    std::string_view unit(rest, size_t(end - rest));
    if (unit.ends_with("iB"))
        unit.remove_suffix(2);
    else if (unit.ends_with('B'))
        unit.remove_suffix(1);
    double factor = 1;
    if (unit == "k" || unit == "K")
        factor = 0x1p10;
    else if (unit == "M")
        factor = 0x1p20;
    else if (unit == "G")
        factor = 0x1p30;
    else if (unit == "T")
        factor = 0x1p40;
    else if (!unit.empty())
        return std::nullopt;
    if (value * factor >= 0x1p63) return std::nullopt;
    return uint64_t(value * factor);
}

std::string formatBytes(uint64_t bytes) {
    const char* units[] = {"B", "KiB", "MiB", "GiB", "TiB"};
    double value = double(bytes);
    int unit = 0;
    while (value >= 1024 && unit < 4) {
        value /= 1024;
        ++unit;
    }
    return unit == 0 || value >= 100 ? fmt::format("{:.0f} {}", value, units[unit])
                                     : fmt::format("{:.1f} {}", value, units[unit]);
}

std::string formatCount(double count) {
    if (count >= 1e9) return fmt::format("{:.2f} G", count / 1e9);
    if (count >= 1e6) return fmt::format("{:.1f} M", count / 1e6);
    if (count >= 1e4) return fmt::format("{:.0f} k", count / 1e3);
    return fmt::format("{:.0f}", count);
}

std::string formatSeconds(double seconds) {
    if (seconds < 60) return fmt::format("{:.1f} s", seconds);
    const auto whole = int64_t(std::llround(seconds));
    if (whole < 3600) return fmt::format("{} min {:02} s", whole / 60, whole % 60);
    return fmt::format("{} h {:02} min", whole / 3600, whole / 60 % 60);
}

}  // namespace pietra
