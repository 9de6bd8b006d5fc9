#pragma once
// Edges in the order of their costs, collapsed until each cell has reached its quota or no edge is
// left that may be.

#include <array>
#include <cmath>
#include <cstdint>

#include "simplify/attributes.h"
#include "simplify/collapse.h"
#include "simplify/collapse_queue.h"
#include "simplify/collapse_sink.h"
#include "simplify/edge_kernels.h"
#include "simplify/position_set.h"
#include "simplify/working_mesh.h"

namespace pietra {

class CollapseLoop {
public:
    CollapseLoop(WorkingMesh& mesh, VertexAttributes& attributes)
        : mesh_(mesh), attributes_(attributes) {}

    /// Ranks and quadrics of the mesh must be set. `grid`: where new vertices may lie.
    /// `free_error`: as in SimplifyInput.
    /// `sink`: told of each collapse, may forbid it; or null.
    void run(const SnapGrid& grid, float free_error, CollapseSink* sink = nullptr);

    /// Of the last run.
    uint32_t collapses() const { return collapses_; }
    /// Root of the largest mean squared distance of a new vertex to its planes.
    float worstDeviation() const { return std::sqrt(worst_deviation_sq_); }

private:
    /// Edges taken from the queue to be collapsed.
    struct Candidates {
        EdgeBatch edges;
        std::array<uint32_t, kBatch> stamp;
        uint32_t count = 0;
    };

    bool stillThere(uint32_t u, uint32_t v, uint32_t stamp) const {
        return mesh_.stamp[u] + mesh_.stamp[v] == stamp;
    }
    void runRounds(float min_shape);
    void collapseFreely(float deviation);
    bool wanted() const { return mesh_.cells_above > 0 || limit_sq_ < HUGE_VALF; }
    float weightOf(uint32_t u, uint32_t v) const {
        return mesh_.quadric[u].area + mesh_.quadric[v].area;
    }
    void fillPositions();
    void pushEdge(uint32_t u, uint32_t v);
    void flushPending();
    void pushAllEdges();
    void pushEdgesAround(uint32_t v);
    void popCandidates();
    void prefetchCandidates() const;
    template <class Body>
    void forFaces(uint32_t lane, Body&& body) const;
    void collapseCandidates();
    bool collapse(uint32_t lane);
    void place(EdgeBatch& edges, uint32_t count) const;

    WorkingMesh& mesh_;
    VertexAttributes& attributes_;
    PositionSet positions_;
    Collapser collapser_{mesh_, positions_};
    EdgeKernels kernels_ = chooseEdgeKernels();
    CollapseQueue queue_;
    SnapGrid grid_;
    EdgeBatch pending_;  // edges to be evaluated and pushed
    uint32_t pending_count_ = 0;
    Candidates candidates_;
    uint32_t current_bucket_ = 0;
    CollapseSink* sink_ = nullptr;
    uint32_t collapses_ = 0;
    float worst_deviation_sq_ = 0;
    float limit_sq_ = HUGE_VALF;  // mean squared distance that no collapse may exceed
};

}  // namespace pietra
