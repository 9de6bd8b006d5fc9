#include "runtime/vertex_numbering.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <map>

#include "base/error.h"
#include "base/hash.h"
#include "geometry/lattice.h"

namespace pietra {
namespace {

const std::string kTemp = std::filesystem::temp_directory_path().string();

/// `count` points of which about half repeat earlier ones.
std::vector<Vec3i> somePoints(uint64_t count, uint64_t seed) {
    std::vector<Vec3i> points;
    for (uint64_t i = 0; i < count; ++i) {
        const uint64_t which = mixBits(seed + mixBits(i)) % (count / 2 + 1);
        points.push_back(latticePoint(mixBits(seed ^ which) >> 1));
    }
    return points;
}

/// Numbers from the plain way.
std::vector<uint64_t> expected(const std::vector<Vec3i>& points) {
    std::map<uint64_t, uint64_t> known;
    std::vector<uint64_t> numbers;
    for (const Vec3i& p : points)
        numbers.push_back(known.try_emplace(latticeKey(p), known.size()).first->second);
    return numbers;
}

std::vector<uint64_t> numbered(const std::vector<Vec3i>& points, size_t memory, uint64_t at_most,
                               size_t first_slice, size_t second_slice, uint64_t* count) {
    Budget budget(memory + points.size() / 6 + 65536);
    VertexNumbering numbering(budget, memory, kTemp, at_most);
    const auto slices = [&](size_t slice, auto&& visit) {
        for (size_t i = 0; i < points.size(); i += slice)
            visit(std::span(points).subspan(i, std::min(slice, points.size() - i)));
    };
    slices(first_slice, [&](std::span<const Vec3i> part) { numbering.note(part); });
    numbering.finishNoting();
    *count = numbering.count();
    std::vector<uint64_t> all, part_numbers;
    slices(second_slice, [&](std::span<const Vec3i> part) {
        numbering.number(part, part_numbers);
        all.insert(all.end(), part_numbers.begin(), part_numbers.end());
    });
    return all;
}

TEST(VertexNumbering, IsThatOfThePlainWayInMemoryAndThroughFiles) {
    for (const uint64_t points : {0u, 1u, 2u, 63u, 64u, 65u, 5000u, 60'000u})
        for (const size_t memory : {size_t(1) << 22, size_t(100) << 10}) {
            const std::vector<Vec3i> input = somePoints(points, points);
            const std::vector<uint64_t> truth = expected(input);
            uint64_t count = 0;
            EXPECT_EQ(numbered(input, memory, points, 17, 1001, &count), truth);
            uint64_t different = 0;
            for (const uint64_t n : truth) different = std::max(different, n + 1);
            EXPECT_EQ(count, different);
        }
}

TEST(VertexNumbering, NothingRepeatsAndEverythingRepeats) {
    std::vector<Vec3i> different, same;
    for (int i = 0; i < 3000; ++i) {
        different.push_back({i, 2 * i, 5});
        same.push_back({1, 2, 3});
    }
    uint64_t count = 0;
    const std::vector<uint64_t> numbers = numbered(different, 1 << 20, 3000, 100, 100, &count);
    EXPECT_EQ(count, 3000u);
    for (uint64_t i = 0; i < 3000; ++i) EXPECT_EQ(numbers[i], i);
    EXPECT_EQ(numbered(same, 1 << 20, 3000, 100, 7, &count), std::vector<uint64_t>(3000, 0));
    EXPECT_EQ(count, 1u);
}

TEST(VertexNumbering, StaysInTheBudget) {
    Budget budget(1000);
    EXPECT_THROW(VertexNumbering(budget, 1 << 20, kTemp, 1 << 20), MemoryError);
}

}  // namespace
}  // namespace pietra
