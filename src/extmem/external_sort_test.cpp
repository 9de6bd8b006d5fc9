#include "extmem/external_sort.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/hash.h"

namespace pietra {
namespace {

struct Pair {
    uint64_t key, value;
    bool operator<(const Pair& o) const { return key != o.key ? key < o.key : value < o.value; }
    bool operator==(const Pair&) const = default;
};

const std::string kTemp = std::filesystem::temp_directory_path().string();

/// What comes back of `count` records, a third of them with equal keys.
std::vector<Pair> sorted(uint64_t count, size_t memory, uint64_t expected, uint64_t* spilled) {
    Budget budget(memory + 1024 * sizeof(Pair));
    ExternalSort<Pair> sort(budget, memory, expected, kTemp, "a test");
    for (uint64_t i = 0; i < count; ++i) {
        const uint64_t bits = mixBits(i);
        sort.append({bits % 3 == 0 ? bits % 100 : bits, i});
    }
    std::vector<Pair> result;
    for (Pair record; sort.next(record);) result.push_back(record);
    EXPECT_EQ(sort.count(), count);
    *spilled = sort.spilledBytes();
    return result;
}

TEST(ExternalSort, GivesTheSameInMemoryAndThroughTheFile) {
    for (const uint64_t count : {0u, 1u, 1023u, 1024u, 1025u, 100'000u}) {
        uint64_t spilled = 0;
        const std::vector<Pair> inside = sorted(count, size_t(64) << 20, count, &spilled);
        EXPECT_EQ(spilled, 0u);
        ASSERT_EQ(inside.size(), count);
        EXPECT_TRUE(std::is_sorted(inside.begin(), inside.end()));
        EXPECT_EQ(sorted(count, size_t(40) << 10, count, &spilled), inside);
        EXPECT_EQ(spilled > 0, count > 2560);
    }
}

TEST(ExternalSort, TakesMoreThanWasExpected) {
    uint64_t spilled = 0;
    EXPECT_EQ(sorted(20'000, size_t(1) << 20, 5000, &spilled).size(), 20'000u);
    EXPECT_GT(spilled, 0u);
}

TEST(ExternalSort, RefusesWhatTheMemoryCannotMerge) {
    Budget budget(size_t(1) << 20);
    ExternalSort<Pair> sort(budget, 16 << 10, 1 << 20, kTemp, "sorting pairs");
    for (uint64_t i = 0; i < 200'000; ++i) sort.append({mixBits(i), i});
    Pair record;
    try {
        sort.next(record);
        FAIL();
    } catch (const MemoryError& error) {
        EXPECT_STREQ(error.what(), "sorting pairs: too much for the memory limit");
    }
}

TEST(ExternalSort, StaysInTheBudget) {
    Budget budget(1000);
    EXPECT_THROW(ExternalSort<Pair>(budget, 1 << 20, 1 << 20, kTemp, "x"), MemoryError);
}

}  // namespace
}  // namespace pietra
