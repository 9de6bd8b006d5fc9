#pragma once
// SplitFront on the GPU, by compute shaders of OpenGL 4.5: after each frame the same active
// vertices, in the order of leaves, to the bit. The rules are those of split_front.cpp, function by
// function, by the same names. What differs:
//
//   - there are no blocks: a vertex is in any slot, and a list has the slots in the order of
//   leaves,
//     made anew after a frame in which anything changed
//   - all splits of a round are applied at once; a frame has as many rounds as splits follow each
//     other, some at a time, and then the GPU is asked whether there are more
//   - nothing is hidden, and there are no limits: as nodes in use stay, `most_nodes` bounds
//   vertices.
//
// Memory, all taken at first: 140 bytes a vertex, of which there are at most 682 a node, 96 a
// split, and a quarter of a byte a leaf; vertex words on top. Needs the context in which it was
// made, current; also to be destroyed.

#include <span>
#include <vector>

#include "gpu/program.h"
#include "methods/pmesh/front/resident_splits.h"
#include "methods/pmesh/front/split_front.h"

namespace pietra::pmesh {

/// All of an active vertex but words; of roots `merged` means nothing.
struct ActiveVertex {
    NestedCriterion birth, next;
    Leaf first, last, parent;
    SplitId split, made;
    SplitVertex vertex, merged;
    std::array<Leaf, 6> leaf;
    bool closed;
    bool operator==(const ActiveVertex&) const = default;
};

class GlSplitFront {
public:
    /// The roots. `nodes` must outlive this, and never have more than `most_nodes` loaded.
    /// `groups`: as many as fill the GPU. Throws MemoryError where the driver has too little.
    GlSplitFront(const ResidentSplits& nodes, uint32_t most_nodes, uint32_t groups = 2048);

    /// `nodes` must have looked at this view, which must not have anything hidden by occlusion.
    /// Waits for the GPU.
    SplitCounts adapt(const SplitView& view);
    /// What these vertices wait for has arrived.
    void arrived(std::span<const ResidentSplits::Arrived> arrived);

    size_t vertexCount() const { return vertices_; }  ///< after the last adapt()
    size_t triangleCount() const { return triangles_; }
    /// In the order of leaves; for tests, slow.
    std::vector<ActiveVertex> download() const;
    std::vector<uint32_t> downloadWords() const;  ///< of each the vertex's

private:
    struct State;
    struct Frame;
    void makePrograms();
    void uploadRoots();
    void mirrorNodes();
    void uploadNode(NodeIndex n);
    void bind(const SplitView& view);
    void run(GLuint program, uint32_t argument, uint32_t groups);
    State told() const;

    const ResidentSplits& nodes_;
    const uint32_t groups_, most_nodes_, leaf_words_, words_;
    const uint32_t capacity_;      ///< vertices
    std::vector<uint32_t> place_;  ///< of nodes that the GPU has, or kNone
    std::vector<NodeIndex> mirrored_;
    std::vector<uint32_t> free_places_;
    GlBuffer state_, vertex_, split_, node_, leaf_, list_, blocking_, frame_;
    GlProgram books_, decide_, merge_, clear_, apply_, index_, arrive_;
    size_t vertices_ = 0, triangles_ = 0;
};

}  // namespace pietra::pmesh
