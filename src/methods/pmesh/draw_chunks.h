#pragma once
// The active mesh cut into chunks that are drawn (multires/live_model.h): pieces of some thousand
// triangles that lie together, each a mesh of its own, made anew only where something has changed.
//
// Every face belongs to a chunk (ActiveFace::chunk). New ones belong to that of a face beside them;
// a chunk that grows too large is cut in two, across its longest side, and one that gets too small
// is given to one beside it. Two passes over the faces a frame with operations, and what the chunks
// that changed cost.
//
// Deterministic. Memory: bytes(), 50 to 60 a vertex; of a frame, four a triangle that it touches;
// 64 KiB a thread. Not thread-safe.

#include <span>
#include <vector>

#include "methods/pmesh/active_mesh.h"
#include "multires/live_model.h"

namespace pietra::pmesh {

class DrawChunks {
public:
    /// After each frame; whatever has changed since the last time has touched its chunk.
    void update(ActiveMesh& mesh);
    std::span<const LiveChunk> chunks() const { return chunk_; }
    /// What it holds.
    size_t bytes() const;

private:
    void list(const ActiveMesh& mesh);
    uint32_t cut(ActiveMesh& mesh, uint32_t chunk);
    bool giveAway(ActiveMesh& mesh, uint32_t chunk);
    void make(const ActiveMesh& mesh, uint32_t chunk);

    std::vector<LiveChunk> chunk_;
    std::vector<std::vector<uint32_t>> face_;   // of each chunk that has changed
    std::vector<std::vector<uint32_t>> slice_;  // scratch
    std::vector<uint32_t> unused_;
    uint64_t version_ = 0;
};

}  // namespace pietra::pmesh
