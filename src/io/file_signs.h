#pragma once
// What tells formats of files apart.

#include <cstdint>
#include <span>
#include <string>
#include <string_view>

namespace pietra {

struct FileSigns {
    std::span<const uint8_t> head;  ///< the first bytes, unpacked: 4 KiB or the whole
    std::string name;               ///< in lower case, without ".gz" or the like
    uint64_t bytes = 0;             ///< of the whole, unpacked; 0 where that is not known

    std::string_view text() const {
        return {reinterpret_cast<const char*>(head.data()), head.size()};
    }
};

}  // namespace pietra
