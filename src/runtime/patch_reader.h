#pragma once
// Reads the patches of a cut from a model file, page by page, all threads decoding, in memory that
// depends on the size of pages alone. For work without a clock: extracting, offline pictures,
// checks. The frame path has its loader.
//
// Throws what ModelReader::decode throws: InputError for a damaged page, with its byte offset.

#include <functional>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "multires/node.h"
#include "store/model_reader.h"

namespace pietra {

/// Throws InputError where the model's pages are not patches, which nothing here and nothing that
/// draws can read.
void requirePatches(const ModelReader& model);

/// Consecutive nodes of the list that lie in one page.
struct PageRun {
    uint32_t page = 0;
    std::span<const NodeIndex> nodes;
};

/// `nodes` strictly increasing.
std::vector<PageRun> pageRuns(std::span<const Node> table, std::span<const NodeIndex> nodes);

/// Visits the patches of `nodes` (strictly increasing), each once, from any thread and in any
/// order.
void visitPatches(const ModelReader& model, std::span<const NodeIndex> nodes,
                  const std::function<void(NodeIndex, const Mesh&)>& visit);

/// The decoded patches of one page run; patch i is that of node run.nodes[i].
struct DecodedRun {
    std::span<const NodeIndex> nodes;
    std::vector<Mesh> patches;
};
using RunVisitor = std::function<void(DecodedRun&)>;

/// What reading took, summed over threads.
struct ReadTimes {
    double load_ms = 0;
    double decode_ms = 0;
};

/// Visits page runs one at a time, in the order of `nodes` (strictly increasing), while at most
/// `in_flight` pages are being decoded ahead. The visitor may take the patches away.
ReadTimes visitInOrder(const ModelReader& model, std::span<const NodeIndex> nodes, size_t in_flight,
                       const RunVisitor& visit);

/// What the meshes of each page take once decoded, about, in bytes.
std::vector<size_t> decodedPageBytes(const ModelReader& model);

/// What the largest page of the model takes once decoded, about, in bytes: what one page in flight
/// costs.
size_t largestDecodedPageBytes(const ModelReader& model);

}  // namespace pietra
