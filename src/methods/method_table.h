#pragma once
// All methods. A new one is a folder beside this file and a line in method_table.cpp.

#include <span>
#include <string_view>

#include "multires/method.h"

namespace pietra {

/// The first one is the default.
std::span<const Method> methods();
/// Null where there is none of this name.
const Method* findMethod(std::string_view name);

}  // namespace pietra
