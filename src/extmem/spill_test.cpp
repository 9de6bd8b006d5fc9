#include "extmem/spill.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <iterator>
#include <span>

#include "base/error.h"
#include "base/parallel.h"
#include "base/scratch_directory.h"

namespace pietra {
namespace {

std::vector<std::byte> pattern(size_t seed, size_t size) {
    std::vector<std::byte> data(size);
    for (size_t i = 0; i < size; ++i) data[i] = std::byte(seed * 31 + i * 7);
    return data;
}

TEST(Spill, givesBackWhatWasAppendedFromMemoryAndFile) {
    Budget budget(20 << 20);
    TempSpace space{testing::TempDir(), &budget, 8 << 20};
    Spill spill(space);
    std::vector<uint64_t> position(400);
    parallelFor(position.size(),
                [&](size_t i) { position[i] = spill.append(pattern(i, 100000 + i)); });
    EXPECT_LE(budget.peak(), 12u << 20);
    EXPECT_GT(budget.peak(), 0u);
    EXPECT_EQ(space.bytes, spill.bytes());
    parallelFor(position.size(), [&](size_t i) {
        std::vector<std::byte> data(100000 + i);
        spill.read(position[i], data);
        EXPECT_EQ(data, pattern(i, data.size())) << i;
    });
    spill.clear();
    EXPECT_EQ(budget.used(), 0u);
    EXPECT_EQ(space.bytes, 0u);
}

TEST(Spill, isWrittenAtAnyPlace) {
    for (const size_t limit : {size_t(0), size_t(4) << 20, size_t(64) << 20}) {
        Budget budget(limit);
        TempSpace space{testing::TempDir(), &budget, 0};
        Spill spill(space);
        constexpr size_t kPiece = 100'003, kPieces = 100;
        for (size_t i = 0; i < kPieces; ++i) {
            const size_t at = i * 37 % kPieces;
            spill.write(at * kPiece, pattern(at + 1, kPiece));
            spill.write(at * kPiece, pattern(at, kPiece));
        }
        EXPECT_EQ(spill.bytes(), kPieces * kPiece);
        EXPECT_EQ(space.bytes, spill.bytes());
        std::vector<std::byte> all(kPieces * kPiece);
        spill.read(0, all);
        for (size_t i = 0; i < kPieces; ++i)
            EXPECT_TRUE(
                std::ranges::equal(std::span(all).subspan(i * kPiece, kPiece), pattern(i, kPiece)));
    }
}

TEST(Spill, outlivesTheProcessWhereItWasSaved) {
    for (const size_t limit : {size_t(0), size_t(4) << 20, size_t(64) << 20}) {
        Budget budget(limit);
        const ScratchDirectory scratch;
        TempSpace space{scratch.path(), &budget, 0, scratch.path()};
        uint64_t saved = 0;
        {
            Spill spill(space, "kept"), unsaved(space, "gone"), unnamed(space);
            for (const size_t i : {1u, 2u}) {
                spill.append(pattern(i, 3'000'000));
                spill.save();
            }
            saved = spill.bytes();
            spill.append(pattern(3, 3'000'000));
            for (Spill* other : {&unsaved, &unnamed}) other->append(pattern(4, 5'000'000));
        }
        EXPECT_EQ(space.bytes, 0u);
        EXPECT_EQ(std::distance(std::filesystem::directory_iterator(scratch.path()), {}), 1);
        Spill spill(space, "kept");
        spill.restore(saved);
        EXPECT_EQ(spill.append(pattern(5, 1000)), saved);
        std::vector<std::byte> all(saved + 1000), expected;
        spill.read(0, all);
        for (const auto& [seed, size] : {std::pair(1u, 3'000'000u), {2u, 3'000'000u}, {5u, 1000u}})
            std::ranges::copy(pattern(seed, size), std::back_inserter(expected));
        EXPECT_TRUE(all == expected);
    }
}

TEST(File, refusesDirectoriesAndMissingFiles) {
    EXPECT_THROW(File(testing::TempDir(), File::Mode::kRead), IoError);
    EXPECT_THROW(File(testing::TempDir() + "/none", File::Mode::kRead), IoError);
}

TEST(AtomicFile, leavesNothingBehindUnlessCommitted) {
    const std::string path = testing::TempDir() + "/atomic";
    std::remove(path.c_str());
    { AtomicFile(path, false).file().write("x", 1); }
    EXPECT_THROW(File(path, File::Mode::kRead), IoError);
    {
        AtomicFile file(path, false);
        file.file().write("x", 1);
        file.commit();
    }
    EXPECT_EQ(File(path, File::Mode::kRead).size(), 1u);
    EXPECT_THROW(AtomicFile(path, false), UsageError);
    EXPECT_NO_THROW(AtomicFile(path, true));
    EXPECT_EQ(File(path, File::Mode::kRead).size(), 1u);
    std::remove(path.c_str());
}

}  // namespace
}  // namespace pietra
