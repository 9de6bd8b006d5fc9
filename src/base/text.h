#pragma once
// Sizes and times as people write and read them.

#include <fmt/format.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace pietra {

/// "512M", "1.5G", "64k", "1000": binary multiples; empty on anything else.
std::optional<uint64_t> parseBytes(std::string_view text);
/// "1.5 GiB", "512 MiB", "17 B".
std::string formatBytes(uint64_t bytes);
/// "118.0 M", "871 k", "42".
std::string formatCount(double count);
/// "0.4 s", "1 min 12 s", "2 h 03 min".
std::string formatSeconds(double seconds);

}  // namespace pietra
