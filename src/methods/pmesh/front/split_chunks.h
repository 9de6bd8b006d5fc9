#pragma once
// The active mesh as chunks that are drawn (multires/live_model.h): each block of vertices with the
// triangles that came with them is a mesh of its own, made anew only where something has changed.
//
// Deterministic. Memory: bytes(), 50 to 60 a vertex. Not thread-safe.

#include <span>
#include <vector>

#include "methods/pmesh/front/resident_splits.h"
#include "methods/pmesh/front/split_blocks.h"
#include "multires/live_model.h"

namespace pietra::pmesh {

class SplitChunks {
public:
    /// Both must outlive this.
    SplitChunks(const ResidentSplits& nodes, const SplitBlocks& blocks);

    /// After each frame.
    void update();
    std::span<const LiveChunk> chunks() const { return chunk_; }
    size_t triangleCount() const;
    /// What it holds.
    size_t bytes() const;

private:
    struct Made {
        uint64_t version = 0;             ///< of the blocks
        std::vector<uint32_t> on_others;  ///< blocks, sorted: what changes there may show here
    };
    bool isStale(uint32_t block) const;
    void make(uint32_t block);
    void makeTriangles(uint32_t block, std::vector<SplitBlocks::Place>& vertex);
    void makeVertices(LiveChunk& chunk, std::span<const SplitBlocks::Place> vertex) const;
    void addBaseTriangles(Leaf root, std::vector<Leaf>& corners, bool& closed) const;

    const ResidentSplits& nodes_;
    const SplitBlocks& blocks_;
    std::vector<Leaf> root_first_;
    std::vector<uint32_t> base_order_, base_begin_;  ///< base triangles by the root of a corner
    std::vector<LiveChunk> chunk_;                   ///< by block
    std::vector<Made> made_;
    uint64_t version_ = 0;
};

}  // namespace pietra::pmesh
