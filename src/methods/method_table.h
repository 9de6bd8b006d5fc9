#pragma once
// All methods. A new one is a folder beside this file and a line in method_table.cpp.

#include <span>
#include <string_view>

#include "multires/method.h"
#include "store/model_reader.h"

namespace pietra {

/// The first one is the default.
std::span<const Method> methods();
/// Null where there is none of this name.
const Method* findMethod(std::string_view name);
/// Of a model: whether its errors are proven bounds, or estimates.
bool provesErrors(const ModelInfo& info);

/// Null for a model whose pages are patches. Throws InputError where the program lacks its method.
std::unique_ptr<AdaptiveModel> openAdaptive(const ModelReader& reader);
/// Likewise; an OpenLive.
std::unique_ptr<LiveModel> openLive(const ModelReader& reader);

}  // namespace pietra
