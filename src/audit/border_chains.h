#pragma once
// Whether the border of a cut is made of the input's own: each of its edges must stand for a way
// along border edges of the input, past vertices that are not kept only. Kept are those in which
// border edges of the cut end. Otherwise a crack could pass for a border.
//
// Memory: some 40 bytes an input border edge, from the budget.

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

    /// How many of a cut's border edges stand for no such way. The order does not matter. Takes
    /// 5 bytes a vertex of the chains, for a while. Thread-safe.
    uint64_t countStray(std::span<const EdgeKey> cut_border) const;

private:
    static constexpr uint32_t kNone = ~uint32_t(0);

    uint32_t find(uint64_t key) const;
    std::span<const uint32_t> neighboursOf(uint32_t v) const {
        return {neighbour_.data() + begin_[v], neighbour_.data() + begin_[v + 1]};
    }

    Reservation reservation_;
    std::vector<uint64_t> vertex_;     // increasing
    std::vector<uint32_t> begin_;      // CSR over neighbour_
    std::vector<uint32_t> neighbour_;  // indices into vertex_
};

/// As countCracks(), and border edges that do not follow the input's count as cracked.
/// Keeps the border edges of the cut in memory, from the budget.
CrackReport countCracksWithin(const BorderChains& chains, const PatchStream& stream,
                              std::span<const NodeIndex> nodes, Budget& budget, size_t memory_bytes,
                              const std::string& temp_dir);

}  // namespace pietra
