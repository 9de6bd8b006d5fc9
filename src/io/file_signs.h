#pragma once
// What tells formats of files apart.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace pietra {

/// What some editors put before a text.
inline constexpr std::string_view kByteOrderMark = "\xef\xbb\xbf";

/// What packers put behind the name of a file.
inline constexpr const char* kPackedEndings[] = {".gz", ".xz", ".zst"};

inline std::string_view withoutMark(std::string_view text) {
    if (text.starts_with(kByteOrderMark)) text.remove_prefix(kByteOrderMark.size());
    return text;
}

struct FileSigns {
    std::span<const uint8_t> head;  ///< the first bytes, unpacked: 4 KiB or the whole
    std::string name;               ///< in lower case, without ".gz" or the like
    uint64_t bytes = 0;             ///< of the whole, unpacked; 0 where that is not known

    /// The first bytes as a text, without the mark.
    std::string_view text() const {
        return withoutMark({reinterpret_cast<const char*>(head.data()), head.size()});
    }
};

}  // namespace pietra
