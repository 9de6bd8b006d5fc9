#pragma once
// Words of a file as messages and notes may show them.

#include <string>
#include <string_view>
#include <vector>

namespace pietra {

/// Short, and without characters that would move the cursor of a terminal.
std::string printable(std::string_view word);

/// "a, b and c", at most nine by name; made printable.
std::string listed(const std::vector<std::string>& words);

/// "element a is left out", or "elements a, b and c are left out". There is at least one.
std::string leftOut(const char* kind, const std::vector<std::string>& names);

}  // namespace pietra
