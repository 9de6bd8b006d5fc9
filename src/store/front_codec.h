#pragma once
// Page body 1, "front": connectivity as one number a vertex (how many triangles it has), found
// again by a traversal from the patch's borders inward; positions by parallelograms; normals from
// the decoded geometry. About half the size of body 0. After Touma and Gotsman, "Triangle mesh
// compression", 1998. FORMAT.md, "Body 1". Internal to src/store.

#include "store/page_format.h"

namespace pietra {

/// Returns false, having written nothing that counts, where the page holds something this body
/// cannot say: a triangle that uses a vertex twice, or a vertex without triangles.
[[nodiscard]] bool encodeFront(const PageHeader& header, std::span<const Mesh* const> patches,
                               ByteWriter& writer);
/// Contract of decodePage; `header` has passed readPageHeader.
[[nodiscard]] bool decodeFront(const PageHeader& header, ByteReader& reader,
                               std::vector<Mesh>& patches, std::string& fault);

}  // namespace pietra
