#pragma once
// Writes down every collapse of the simplifier as the vertex split that undoes it, and forbids
// those that no split could undo:
//   - of irregular vertices (non-manifold edges, bow-ties): locked, they stay in the base mesh;
//   - of stars with more neighbours than ranks can tell.
// Where an edge is so long beside others around it that eight bits a coordinate would not do, its
// ends are first moved by dummy operations.
//
// Heights are levels counted from the fine side: one more than the largest height around. So they
// are known while collapsing, whatever comes later and elsewhere.

#include <array>
#include <cstdint>
#include <span>
#include <vector>

#include "methods/pmesh/operations.h"
#include "simplify/collapse_sink.h"

namespace pietra::pmesh {

inline constexpr uint32_t kNoVertex = ~0u;

/// A dummy has no u, left and right. Vertices are those of the mesh that is simplified; positions
/// in steps.
struct CollapseRecord {
    uint32_t v, u = kNoVertex;
    uint32_t left = kNoVertex, right = kNoVertex;
    std::array<Vec3i, 2> position;   ///< of v and of u, before
    std::array<uint16_t, 2> normal;  ///< the same
    std::array<uint32_t, 2> child;   ///< the records that v and u came from, or kNoOperation
    uint32_t height;                 ///< from 1
    float deviation;                 ///< lattice units, an estimate: Collapser::deviation()
};

/// How the offsets of one operation's ends are stored.
struct QuantisedOffsets {
    uint8_t shift = 0;
    std::array<std::array<int8_t, 3>, 2> delta;
};
QuantisedOffsets quantiseOffsets(const std::array<Vec3i, 2>& offset);

class Recorder : public CollapseSink {
public:
    struct Refused {
        uint64_t irregular = 0, valence = 0, level = 0;
    };

    /// `mesh`: the one that is simplified; `irregular`: one a vertex, as HalfEdges has it; both
    /// must outlive this. Positions are multiples of 2^shift.
    Recorder(const Mesh& mesh, std::span<const uint8_t> irregular, int shift);

    bool take(const CollapseStep& step) override;

    const std::vector<CollapseRecord>& records() const { return record_; }
    uint32_t largestHeight() const { return largest_; }
    uint64_t dummies() const { return dummies_; }
    /// Attempts, not edges: an edge may be tried again.
    const Refused& refused() const { return refused_; }
    /// The record of the last collapse into v, or kNoOperation.
    uint32_t lastOf(uint32_t v) const { return last_[v]; }
    OctNormal normalOf(uint32_t v) const { return normal_[v]; }

private:
    float precisionAt(const CollapseStep& step, uint32_t end) const;
    void recordDummy(const CollapseStep& step, uint32_t end);
    void push(const CollapseRecord& record);
    uint32_t heightOf(uint32_t v) const {
        return last_[v] == kNoOperation ? 0 : record_[last_[v]].height;
    }
    Vec3i stepsOf(const WorkingMesh& mesh, const Vec3f& p) const;

    std::span<const uint8_t> irregular_;
    int shift_;
    std::vector<OctNormal> normal_;
    std::vector<uint32_t> last_;
    std::vector<CollapseRecord> record_;
    uint32_t largest_ = 0;
    uint64_t dummies_ = 0;
    Refused refused_;
};

}  // namespace pietra::pmesh
