#include "base/check.h"

namespace pietra {

void failCheck(const char* file, int line, const std::string& what) {
    throw BugError(fmt::format("{}:{}: {}", file, line, what));
}

}  // namespace pietra
