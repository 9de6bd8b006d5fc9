#include "methods/pmesh/ring_starts.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pietra::pmesh {
namespace {

/// As a search for the least name in each ring: in memory and beyond it, in whatever order names
/// come, and whatever numbers vertices have.
TEST(RingStarts, AreWhereTheLeastNameIs) {
    constexpr uint32_t kVertices = 200'000, kCollapses = 100'000;
    for (const size_t limit : {size_t(3) << 19, size_t(1) << 28}) {
        Budget budget(limit);
        TempSpace space{testing::TempDir(), &budget, limit / 2};
        std::mt19937 random(3);
        const auto below = [&](uint32_t n) { return uint32_t(random() % n); };
        Collapses collapses(space);
        // Each third number is one more of the vertex before.
        std::vector<VertexId> id;
        std::vector<uint32_t> number, name;
        for (uint32_t v = 0; v < kVertices; ++v) {
            number.push_back(v);
            name.push_back(v % 3 == 2 ? name.back() : v * 7919u % kVertices);
            id.push_back(v % 3 == 0 ? v : kShared | uint64_t(v / 3) << 20);
            if (v % 3 == 0) continue;
            const VertexAlias alias{id.back(), v};
            collapses.store.append({&alias, 1});
        }
        collapses.numbers = kVertices;
        std::vector<uint32_t> expected;
        while (collapses.store.size() < kCollapses) {
            std::vector<CollapseRecord> records(1 + below(50));
            std::vector<CollapseLink> links(records.size());
            for (CollapseRecord& r : records) {
                r.ring_size = uint8_t(below(kMaxNeighbours + 1));
                r.closed = r.ring_size >= 3 && below(5) > 0;
                // As it is, rings are of near ones; no two of a ring are one vertex.
                const uint32_t around = below(kVertices / 3 - 3 * kMaxNeighbours);
                for (uint32_t i = 0; i < r.ring_size; ++i)
                    r.ring[i] = 3 * (around + 3 * i % 44) + below(3);
                const auto least =
                    std::min_element(r.ring.begin(), r.ring.begin() + r.ring_size,
                                     [&](uint32_t a, uint32_t b) { return name[a] < name[b]; });
                expected.push_back(r.closed ? uint32_t(least - r.ring.begin()) : 0);
            }
            collapses.store.append(links, records, number);
        }
        RingStarts starts(collapses, space);
        for (uint32_t v = kVertices; v-- > 0;)
            if (v % 3 != 2) starts.addName(id[v], name[v]);
        starts.find();
        for (uint32_t i = 0; i < expected.size(); ++i)
            if (expected[i] > 0) {
                ASSERT_EQ(starts.of(i), expected[i]) << i;
            }
        EXPECT_LE(budget.peak(), limit);
    }
}

}  // namespace
}  // namespace pietra::pmesh
