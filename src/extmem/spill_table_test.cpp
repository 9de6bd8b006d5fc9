#include "extmem/spill_table.h"

#include <gtest/gtest.h>

#include <map>

#include "base/hash.h"

namespace pietra {
namespace {

struct Number {
    uint64_t value;
    uint64_t hash() const { return mixBits(value); }
    bool operator<(const Number& o) const { return value < o.value; }
};

TEST(SpillTable, givesBackEveryRecordGroupedByKey) {
    for (const uint64_t count : {0, 1, 1000, 300000}) {
        Budget budget(2 << 20);
        SpillTable<Number> table(budget, 1 << 20, testing::TempDir(), "numbers");
        parallelForSlices(count, 777, [&](size_t begin, size_t end) {
            std::vector<Number> some;
            for (size_t i = begin; i < end; ++i) some.push_back({mixBits(i % 50000)});
            table.append(some);
        });
        EXPECT_EQ(table.count(), count);
        EXPECT_EQ(table.spilledBytes() > 0, count == 300000);
        for (int again = 0; again < 2; ++again) {
            std::mutex mutex;
            std::map<uint64_t, int> seen;
            table.forEachRun([&](std::span<const Number> run) {
                const std::lock_guard lock(mutex);
                EXPECT_TRUE(std::is_sorted(run.begin(), run.end()));
                std::map<uint64_t, int> here;
                for (const Number& n : run) ++here[n.value];
                for (const auto& [value, uses] : here)
                    EXPECT_TRUE(seen.insert({value, uses}).second);
            });
            uint64_t total = 0;
            for (const auto& [value, uses] : seen) total += uint64_t(uses);
            EXPECT_EQ(total, count);
        }
    }
}

TEST(SpillTable, refusesWhatCannotBeGrouped) {
    Budget budget(2 << 20);
    SpillTable<Number> table(budget, 1 << 20, testing::TempDir(), "numbers");
    table.append(std::vector<Number>(100000, Number{7}));
    try {
        table.forEachRun([](std::span<const Number>) {});
        FAIL();
    } catch (const MemoryError& error) {
        EXPECT_STREQ(error.what(), "numbers: too many equal keys for the memory limit");
    }
}

}  // namespace
}  // namespace pietra
