#pragma once
// Pages of operations: a node, or a base mesh, as compressed bytes. src/store/FORMAT.md has the
// layout ("Body 2"). Everything survives exactly.
//
// Slots are numbered in the order of reference (operation_node.h), so two bits tell a child code.
// What an operation has in common with the one above it, where that lies in the same node, is left
// out: level, criteria and normals are coded as differences. Then byte planes behind zstd.
//
// Pure functions, thread-safe; scratch memory per thread.

#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "methods/pmesh/operation_node.h"

namespace pietra::pmesh {

std::vector<std::byte> encodeNode(const OperationNode& node);

/// Untrusted bytes: false with a sentence in `fault`, never a throw; what is true has no fault by
/// itself (faultOf()). `layout`: the model's. `row`: with indices known to be good. After a failure
/// `node` is unspecified.
[[nodiscard]] bool decodeNode(std::span<const std::byte> bytes, NodeIndex index, const NodeRow& row,
                              WordLayout layout, OperationNode& node, std::string& fault);

/// The base mesh and its vertices' first operations.
std::vector<std::byte> encodeBase(const NodeForest& forest);

/// Untrusted bytes of such a format, as above. forest.row and forest.layout must be set: each
/// operation is in a root's frontier, each at most once, and its triangles' corners are there. Sets
/// the base only.
[[nodiscard]] bool decodeBase(std::span<const std::byte> bytes, uint32_t format, NodeForest& forest,
                              std::string& fault);

/// ModelIdentity::method_format of files written now, and those from which on something is told.
inline constexpr uint32_t kMethodFormat = 2, kFormatWithClosed = 1, kFormatWithNormals = 2;

}  // namespace pietra::pmesh
