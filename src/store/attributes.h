#pragma once
// The section that says what a model's vertices carry. FORMAT.md, "Attributes". Internal to
// src/store.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace pietra {

std::vector<std::byte> encodeAttributes(const AttributeSchema& schema);
/// Untrusted bytes: returns false with a sentence in `fault`.
[[nodiscard]] bool decodeAttributes(std::span<const std::byte> bytes, AttributeSchema& schema,
                                    std::string& fault);

}  // namespace pietra
