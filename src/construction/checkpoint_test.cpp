#include "construction/checkpoint.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "base/scratch_directory.h"

namespace pietra {
namespace {

StateWriter stateOf(int value) {
    StateWriter state;
    state.put(value);
    return state;
}

TEST(Checkpoint, IsTakenUpByTheSameBuildOnly) {
    const ScratchDirectory scratch;
    {
        Checkpoint first(scratch.path(), "one", false, 0);
        EXPECT_TRUE(first.isDue());
        first.save(Checkpoint::kFirst, stateOf(7));
        first.save("more", stateOf(1));
        first.save("more", stateOf(2));
    }
    EXPECT_FALSE(Checkpoint(scratch.path(), "another", true, 0).resumes());
    {
        Checkpoint again(scratch.path(), "one", true, 0);
        ASSERT_TRUE(again.resumes());
        EXPECT_EQ(again.load(Checkpoint::kFirst)->get<int>(), 7);
        EXPECT_EQ(again.load("more")->get<int>(), 2);
        EXPECT_FALSE(again.load("less"));
    }
    EXPECT_FALSE(Checkpoint(scratch.path(), "one", false, 0).resumes());
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
}

TEST(Checkpoint, IsForOneAtATime) {
    const ScratchDirectory scratch;
    Checkpoint first(scratch.path(), "one", false, 0);
    Checkpoint second(scratch.path(), "one", false, 0);
    EXPECT_EQ(second.folder(), "");
    EXPECT_FALSE(second.isDue());
    EXPECT_THROW(Checkpoint(scratch.path(), "one", true, 0), UsageError);
}

TEST(Checkpoint, LeavesNothingOfWhatIsDoneOrWasNeverSaved) {
    const ScratchDirectory scratch;
    { Checkpoint(scratch.path(), "one", false, 0).isDue(); }
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
    {
        Checkpoint done(scratch.path(), "one", false, 0);
        done.save(Checkpoint::kFirst, stateOf(7));
        done.finish();
    }
    EXPECT_TRUE(std::filesystem::is_empty(scratch.path()));
    EXPECT_EQ(Checkpoint(scratch.path(), "", true, 0).folder(), "");
}

TEST(Checkpoint, IsNothingWhereItIsDamaged) {
    const ScratchDirectory scratch;
    std::string path;
    {
        Checkpoint first(scratch.path(), "one", false, 0);
        first.save(Checkpoint::kFirst, stateOf(-1));  // whose last byte is not zero
        path = first.folder() + "/input.state";
    }
    const uint64_t size = std::filesystem::file_size(path);
    std::filesystem::resize_file(path, size - 1);
    std::filesystem::resize_file(path, size);
    EXPECT_EQ(Checkpoint(scratch.path(), "one", true, 0).resumes(), false);
}

}  // namespace
}  // namespace pietra
