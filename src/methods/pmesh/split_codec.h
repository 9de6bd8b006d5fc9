#pragma once
// Pages of splits: a node, or a base mesh, as compressed bytes. src/store/FORMAT.md has the layout
// ("Body 2"). Everything survives exactly.
//
// Slots are numbered in the order of reference (split_node.h), so two bits tell a child code. What
// a split has in common with the one above it, where that lies in the same node, is left out:
// criteria and normals are coded as differences. Then byte planes behind zstd.
//
// Pure functions, thread-safe; scratch memory per thread.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "methods/pmesh/split_node.h"

namespace pietra::pmesh {

std::vector<std::byte> encodeSplitNode(const SplitNode& node);

/// Untrusted bytes: false with a sentence in `fault`, never a throw; what is true has no fault by
/// itself (faultOf()). `layout`: the model's. `row`: with indices known to be good. After a failure
/// `node` is unspecified.
[[nodiscard]] bool decodeSplitNode(std::span<const std::byte> bytes, const SplitRow& row,
                                   WordLayout layout, SplitNode& node, std::string& fault);

/// The base mesh and the grid.
std::vector<std::byte> encodeSplitBase(const SplitForest& forest);

/// Untrusted bytes, as above. forest.row, .lattice and .layout must be set; what is true is the
/// base of a forest with such rows: each split in a root's frontier at most once and in order, all
/// on the lattice, and corners that are leaves. Sets base and grid only.
[[nodiscard]] bool decodeSplitBase(std::span<const std::byte> bytes, SplitForest& forest,
                                   std::string& fault);

/// ModelIdentity::method_format of files written now. Versions before had stars and levels.
inline constexpr uint32_t kMethodFormat = 3;

}  // namespace pietra::pmesh
