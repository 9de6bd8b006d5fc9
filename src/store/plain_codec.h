#pragma once
// Page body 0, "plain": columns of 32-bit numbers as byte planes behind zstd. It takes every mesh,
// decodes with a few loops, and is what the cleverer bodies fall back to. FORMAT.md, "Body 0".
// Internal to src/store.

#include "store/page_format.h"

namespace pietra {

void encodePlain(const PageHeader& header, std::span<const Mesh* const> patches,
                 ByteWriter& writer);
/// Contract of decodePage; `header` has passed readPageHeader.
[[nodiscard]] bool decodePlain(const PageHeader& header, ByteReader& reader,
                               std::vector<Mesh>& patches, std::string& fault);

}  // namespace pietra
