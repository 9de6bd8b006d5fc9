#include "base/error.h"

#include <fmt/format.h>

#include <cstring>

namespace pietra {

InputError::InputError(const std::string& path, const std::string& place, const std::string& what)
    : Error(3, place.empty() ? fmt::format("{}: {}", path, what)
                             : fmt::format("{}: {}: {}", path, place, what)) {}

InputError InputError::atByte(const std::string& path, uint64_t offset, const std::string& what) {
    return InputError(path, fmt::format("byte {}", offset), what);
}

InputError InputError::atLine(const std::string& path, uint64_t line, const std::string& what) {
    return InputError(path, fmt::format("line {}", line), what);
}

IoError::IoError(const std::string& path, const std::string& operation, int error_number)
    : Error(4, fmt::format("{}: cannot {}: {}", path, operation, std::strerror(error_number))) {}

}  // namespace pietra
