#pragma once
// Which leaves the third corners of the triangles are that collapses remove. Wings tell vertices by
// numbers; which leaf is the first of each is known only after packing. As many leaves as there is
// room for are brought together with all wings. Those of vertices with several numbers are first
// brought to each, by their keys.
//
// The result is a function of the leaves. Linear, times how often the leaves, four bytes each, fill
// the memory given; the rest lies in temporary space.

#include "methods/pmesh/collapses.h"

namespace pietra::pmesh {

class WingLeaves {
public:
    /// Both must outlive this. Once a leaf has come, takes up to half of what the budget has.
    WingLeaves(const Collapses& collapses, TempSpace& space);
    ~WingLeaves();

    /// The first one of a vertex, each once.
    void add(VertexId vertex, Leaf first);
    /// Once, when all are there.
    void find();
    /// The third corners of both wings; of one that is not there, any.
    std::array<Leaf, 2> of(uint32_t record) { return found_[record]; }

private:
    class Shared;
    struct NumberLeaf {
        uint32_t number;
        Leaf first;
    };
    void addBatch(std::vector<NumberLeaf>& batch);
    void load(uint32_t begin, std::span<Leaf> leaves) const;
    void bring(uint32_t begin, std::span<const Leaf> leaves);

    const Collapses& collapses_;
    TempSpace& space_;
    std::unique_ptr<Shared> shared_;
    std::vector<NumberLeaf> batch_;
    Spill leaves_;   // of numbers, in any order
    Spill corners_;  // one a record
    CachedRecords<std::array<Leaf, 2>> found_;
};

}  // namespace pietra::pmesh
