#pragma once
// The files of shaders/, as CMake puts them into the program.

#include <string_view>

namespace pietra {

/// The text of shaders/NAME; empty where there is no such file.
std::string_view splitText(std::string_view name);

}  // namespace pietra
