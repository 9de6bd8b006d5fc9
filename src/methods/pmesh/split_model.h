#pragma once
// A progressive mesh's file, read from end to end: what `extract` and `check` need (multires/
// adaptive_model.h). A cut is what a view or an error needs, by the same rule as at run time; nodes
// are read parents first, those only that have a part in it, and kept while they are looked at.
//
// Memory of a cut: its mesh, 24 bytes a triangle and 20 a vertex; 1.5 bits a leaf; and 40 bytes a
// split that a node read has in its children. MemoryError where the budget has less.

#include <memory>

#include "methods/pmesh/split_node.h"
#include "multires/adaptive_model.h"
#include "store/model_reader.h"

namespace pietra::pmesh {

/// Throws InputError where the base mesh or the table of nodes is damaged.
std::unique_ptr<AdaptiveModel> openModel(const ModelReader& reader);

/// Rows and base mesh, no nodes; likewise.
SplitForest openForest(const ModelReader& reader);
/// Empty, or a sentence about the node's page.
[[nodiscard]] std::string readNode(const ModelReader& reader, const SplitForest& forest,
                                   NodeIndex index, SplitNode& node);

}  // namespace pietra::pmesh
