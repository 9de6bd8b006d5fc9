#pragma once
// The node table's unit on disk: some two thousand consecutive nodes of one level with the entries
// of the pages that hold their patches, as columns behind zstd; about 30 bytes a node. FORMAT.md,
// "Node blocks". Everything of a Node survives exactly but its cone, which comes back a little
// wider (by up to about a degree). Pure functions. Internal to src/store.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "multires/node.h"
#include "store/model_format.h"

namespace pietra {

/// A page as the block records it.
struct PageRecord {
    uint64_t checksum = 0;  ///< XXH3-64 of the page
    uint32_t bytes = 0;
    uint32_t node_count = 0;  ///< its nodes follow those of the page before
};

/// `face_sizes`: whether the block has them (ModelInfo). `nodes` carry global child indices; their
/// page, patch and level are not stored: they follow from the order.
std::vector<std::byte> encodeNodeBlock(std::span<const Node> nodes,
                                       std::span<const PageRecord> pages, bool face_sizes);

/// Appends entry.node_count nodes and entry.page_count pages, or returns false with a sentence in
/// `fault`. Untrusted bytes: never throws; the numbers are those of the file, not yet checked for
/// sense (children, counts), but floats are finite and each node has a page.
[[nodiscard]] bool decodeNodeBlock(std::span<const std::byte> bytes, const BlockEntry& entry,
                                   bool face_sizes, std::vector<Node>& nodes,
                                   std::vector<PageRecord>& pages, std::string& fault);

/// The cone as it is stored: every normal within `cone` is within the result.
NormalCone storedCone(const NormalCone& cone);

}  // namespace pietra
