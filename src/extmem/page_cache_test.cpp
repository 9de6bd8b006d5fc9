#include "extmem/page_cache.h"

#include <gtest/gtest.h>

#include "base/error.h"
#include "base/scratch_directory.h"
#include "extmem/file.h"

namespace pietra {
namespace {

TEST(PageCache, aFileIsCachedUntilItIsDropped) {
    const ScratchDirectory scratch;
    const std::string path = scratch.file("data");
    const std::vector<char> data(3'000'001, 'x');
    File(path, File::Mode::kCreate).write(data.data(), data.size());
    EXPECT_EQ(cachedBytes(path), data.size());
    const uint64_t left = dropPageCache(path);
    EXPECT_EQ(left, cachedBytes(path));
    if (left == data.size()) GTEST_SKIP() << "this file system has no other place than memory";
    EXPECT_EQ(left, 0u);
}

TEST(PageCache, anEmptyFileAndAMissingOne) {
    const ScratchDirectory scratch;
    EXPECT_EQ(dropPageCache(scratch.write("empty", "")), 0u);
    EXPECT_THROW(dropPageCache(scratch.file("none")), IoError);
}

}  // namespace
}  // namespace pietra
