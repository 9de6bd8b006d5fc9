#pragma once
// A progressive mesh's file, whole in memory: what `extract` and `check` need (multires/
// adaptive_model.h). Cuts are made by the same adaption as at run time (adaption.h), from the base,
// and so depend on file and request alone.
//
// Memory: kModelBytes an operation or base vertex, or MemoryError.

#include <memory>

#include "methods/pmesh/operation_node.h"
#include "multires/adaptive_model.h"
#include "store/model_reader.h"

namespace pietra::pmesh {

inline constexpr size_t kModelBytes = 300;

/// Throws InputError where the base mesh or the table of nodes is damaged.
std::unique_ptr<AdaptiveModel> openModel(const ModelReader& reader);

/// Rows and base mesh, no nodes; likewise.
NodeForest openForest(const ModelReader& reader);
/// Empty, or a sentence about the node's page.
[[nodiscard]] std::string readNode(const ModelReader& reader, const NodeForest& forest,
                                   NodeIndex index, OperationNode& node);

}  // namespace pietra::pmesh
