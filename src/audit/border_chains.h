#pragma once
// Whether the border of a cut is made of the input's own: each border edge of a cut must join two
// consecutive kept vertices of one border chain of the input. Otherwise a crack could pass for a
// border.
//
// The border edges of the input form a graph; a chain is a path of it through vertices where two
// border edges meet, from one other vertex to another, or a closed loop. Kept are the vertices that
// border edges of the cut end in. Memory: some 40 bytes an input border edge, from the budget.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "audit/cracks.h"
#include "base/budget.h"

namespace pietra {

class BorderChains {
public:
    /// `border`: of the input, increasing, without doubles (InputSurvey::border). Throws
    /// MemoryError.
    BorderChains(std::span<const EdgeKey> border, Budget& budget);

    /// How many of a cut's border edges are no piece of a chain. The order does not matter. Takes
    /// 24 bytes a border edge of the cut and 16 a vertex of the chains, for a while. Thread-safe.
    uint64_t countStray(std::span<const EdgeKey> cut_border) const;

private:
    static constexpr uint32_t kNone = ~uint32_t(0);
    class Walk;

    uint32_t find(uint64_t key) const;
    uint32_t degree(uint32_t v) const { return begin_[v + 1] - begin_[v]; }

    Reservation reservation_;
    std::vector<uint64_t> vertex_;     // increasing
    std::vector<uint32_t> begin_;      // CSR over neighbour_
    std::vector<uint32_t> neighbour_;  // indices into vertex_
};

/// As countCracks(), and border edges that are no piece of the input's chains count as cracked.
/// Keeps the border edges of the cut in memory, from the budget.
CrackReport countCracksWithin(const BorderChains& chains, const PatchStream& stream,
                              std::span<const NodeIndex> nodes, Budget& budget, size_t memory_bytes,
                              const std::string& temp_dir);

}  // namespace pietra
