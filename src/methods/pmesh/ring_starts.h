#pragma once
// From which neighbour the ranks of each collapse's star count: the one of the least name. Rings
// tell vertices by numbers; their names, places in nodes, are known only after packing. As many
// names as there is room for are brought together with all rings, which keep the least so far.
// Those of vertices with several numbers are first brought to each, by their keys.
//
// The result is a function of the names. Linear, times how often the names, four bytes each, fill
// the memory given; the rest lies in temporary space.

#include "methods/pmesh/collapses.h"

namespace pietra::pmesh {

class RingStarts {
public:
    /// Both must outlive this. Once a name has come, takes up to half of what the budget has.
    RingStarts(const Collapses& collapses, TempSpace& space);
    ~RingStarts();

    /// Each vertex once.
    void addName(VertexId vertex, uint32_t name);
    /// Once, when all names are there.
    void find();
    /// The place in a closed ring from which ranks count.
    uint32_t of(uint32_t record) { return uint32_t(found_[record] % kPlaces); }

private:
    class SharedNames;
    struct NumberName {
        uint32_t number, name;
    };
    void addBatch(std::vector<NumberName>& batch);
    void loadNames(uint32_t first, std::span<uint32_t> names) const;
    void takeLeast(uint32_t first, std::span<const uint32_t> names);

    static constexpr uint64_t kPlaces = 16;
    const Collapses& collapses_;
    TempSpace& space_;
    std::unique_ptr<SharedNames> shared_;
    std::vector<NumberName> batch_;
    Spill names_;  // of numbers, in any order
    Spill least_;  // one a record: the least name so far * kPlaces + its place
    CachedRecords<uint64_t> found_;
};

}  // namespace pietra::pmesh
