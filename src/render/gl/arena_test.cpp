#include "render/gl/arena.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <random>

#include "base/check.h"

namespace pietra {
namespace {

constexpr size_t kGranules = 700;

/// What the allocator does, granule by granule.
class Reference {
public:
    bool free(size_t offset, size_t bytes) const {
        for (size_t g = offset / kArenaGranule; g < (offset + bytes) / kArenaGranule; ++g)
            if (g >= kGranules || used_[g]) return false;
        return true;
    }
    void mark(const ArenaBlock& block, bool used) {
        for (size_t g = 0; g < block.bytes / kArenaGranule; ++g)
            used_[block.offset / kArenaGranule + g] = used;
    }
    size_t largestFreeBytes() const {
        size_t largest = 0, run = 0;
        for (const bool used : used_) largest = std::max(largest, run = used ? 0 : run + 1);
        return largest * kArenaGranule;
    }
    size_t usedBytes() const {
        return size_t(std::count(used_.begin(), used_.end(), true)) * kArenaGranule;
    }

private:
    std::vector<bool> used_ = std::vector<bool>(kGranules, false);
};

TEST(Arena, AllocatesWhateverFitsAndNothingTwice) {
    for (const unsigned seed : {1u, 2u, 3u, 4u}) {
        std::mt19937 random(seed);
        ArenaAllocator arena(kGranules * kArenaGranule + kArenaGranule - 1);
        ASSERT_EQ(arena.capacity(), kGranules * kArenaGranule);
        Reference reference;
        std::vector<ArenaBlock> blocks;
        const size_t largest = seed % 2 == 0 ? 500 : 20000;
        for (int step = 0; step < 20000; ++step) {
            // Fuller and emptier in turns.
            const bool take = random() % 100 < (step / 500 % 2 == 0 ? 65 : 35);
            if (take) {
                const size_t bytes = 1 + random() % largest;
                const size_t room = reference.largestFreeBytes();
                const auto block = arena.allocate(bytes);
                ASSERT_EQ(block.has_value(), bytes <= room) << bytes << " of " << room;
                if (!block) continue;
                ASSERT_EQ(block->offset % kArenaGranule, 0u);
                ASSERT_GE(block->bytes, bytes);
                ASSERT_LT(block->bytes, bytes + kArenaGranule);
                ASSERT_TRUE(reference.free(block->offset, block->bytes));
                reference.mark(*block, true);
                blocks.push_back(*block);
            } else if (!blocks.empty()) {
                std::swap(blocks[random() % blocks.size()], blocks.back());
                reference.mark(blocks.back(), false);
                arena.free(blocks.back());
                blocks.pop_back();
            }
            ASSERT_EQ(arena.used(), reference.usedBytes());
        }
        for (const ArenaBlock& block : blocks) arena.free(block);
        EXPECT_EQ(arena.used(), 0u);
        EXPECT_TRUE(arena.allocate(arena.capacity()));  // all merged again
    }
}

TEST(Arena, HoldsNothingWhereItHasNoRoom) {
    ArenaAllocator none(kArenaGranule - 1);
    EXPECT_EQ(none.capacity(), 0u);
    EXPECT_FALSE(none.allocate(1));
    ArenaAllocator one(kArenaGranule);
    EXPECT_FALSE(one.allocate(kArenaGranule + 1));
    EXPECT_FALSE(one.allocate(~size_t(0)));
    EXPECT_TRUE(one.allocate(1));
    EXPECT_FALSE(one.allocate(1));
}

TEST(Arena, FindsFaultWithBlocksFreedTwice) {
    ArenaAllocator arena(1 << 16);
    const ArenaBlock block = *arena.allocate(100);
    arena.free(block);
    EXPECT_THROW(arena.free(block), BugError);
}

TEST(Arena, ManagesMoreThanFourGigabytes) {
    ArenaAllocator arena(size_t(100) << 30);
    const auto low = arena.allocate(size_t(60) << 30), high = arena.allocate(size_t(40) << 30);
    ASSERT_TRUE(low && high);
    EXPECT_EQ(low->offset + high->offset, size_t(60) << 30);
    EXPECT_FALSE(arena.allocate(1));
}

}  // namespace
}  // namespace pietra
