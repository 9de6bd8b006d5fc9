#include "extmem/page_cache.h"

#include <gtest/gtest.h>

#include <filesystem>

#include "base/error.h"
#include "extmem/file.h"

namespace pietra {
namespace {

TEST(PageCache, aFileIsCachedUntilItIsDropped) {
    const std::string path = std::filesystem::temp_directory_path() / "pietra-page-cache-test";
    const std::vector<char> data(3'000'001, 'x');
    File(path, File::Mode::kCreate).write(data.data(), data.size());
    EXPECT_EQ(cachedBytes(path), data.size());
    const uint64_t left = dropPageCache(path);
    EXPECT_EQ(left, cachedBytes(path));
    std::filesystem::remove(path);
    if (left == data.size()) GTEST_SKIP() << "this file system has no other place than memory";
    EXPECT_EQ(left, 0u);
}

TEST(PageCache, anEmptyFileAndAMissingOne) {
    const std::string path = std::filesystem::temp_directory_path() / "pietra-page-cache-empty";
    File(path, File::Mode::kCreate);
    EXPECT_EQ(dropPageCache(path), 0u);
    std::filesystem::remove(path);
    EXPECT_THROW(dropPageCache(path), IoError);
}

}  // namespace
}  // namespace pietra
