#include "apps/pietra/values.h"

#include <gtest/gtest.h>

#include <functional>

#include "base/error.h"

namespace pietra {
namespace {

std::string faultOf(const std::function<void()>& action) {
    try {
        action();
    } catch (const UsageError& error) {
        return error.what();
    }
    return "";
}

TEST(Values, numbers) {
    EXPECT_EQ(parseNumber("0.5"), 0.5);
    EXPECT_EQ(parseNumber("-1e-3"), -1e-3);
    for (const char* wrong : {"", " 1", "1 ", "1,5", "0x10", "nan", "inf", "1e999", "one", "1m"})
        EXPECT_EQ(faultOf([&] { parseNumber(wrong); }),
                  "'" + std::string(wrong) + "' is not a number");
    EXPECT_EQ(faultOf([] { parseNumber("-1", {.min = 0}); }), "'-1' must be at least 0");
    EXPECT_EQ(faultOf([] { parseNumber("0", {.min = 0, .above = true}); }),
              "'0' must be more than 0");
    EXPECT_EQ(faultOf([] { parseNumber("181", {.max = 180}); }), "'181' must be at most 180");
}

TEST(Values, counts) {
    EXPECT_EQ(parseCount("0"), 0u);
    EXPECT_EQ(parseCount("12345678901"), 12345678901u);
    EXPECT_EQ(parseCount("64k"), 64000u);
    EXPECT_EQ(parseCount("2.5M"), 2500000u);
    EXPECT_EQ(parseCount("1G"), 1000000000u);
    for (const char* wrong :
         {"", "-1", "1.5", "M", "1T", "1 k", "1e6", "99999999999999999999", "nank"})
        EXPECT_EQ(faultOf([&] { parseCount(wrong); }),
                  "'" + std::string(wrong) + "' is not a count (such as 1000, 64k or 2.5M)");
    EXPECT_EQ(faultOf([] { parseCount("3", {.min = 4}); }), "'3' must be at least 4");
    EXPECT_EQ(faultOf([] { parseCount("1k", {.max = 512}); }), "'1k' must be at most 512");
}

TEST(Values, sizes) {
    EXPECT_EQ(parseSize("512M"), 512u << 20);
    EXPECT_EQ(parseSize("1000"), 1000u);
    for (const char* wrong : {"", "12Q", "M", "-1G", "1 G"})
        EXPECT_EQ(faultOf([&] { parseSize(wrong); }),
                  "'" + std::string(wrong) + "' is not a size (such as 512M, 1.5G or 1000000)");
}

TEST(Values, pictureSizes) {
    EXPECT_EQ(parsePictureSize("1280x1024").width, 1280);
    EXPECT_EQ(parsePictureSize("1280x1024").height, 1024);
    for (const char* wrong : {"", "x", "1280", "1280x", "x1024", "1280X1024", "12x34x56", "1.5x2"})
        EXPECT_EQ(faultOf([&] { parsePictureSize(wrong); }),
                  "'" + std::string(wrong) + "' is not a picture size (such as 1280x1024)");
    for (const char* wrong : {"0x10", "10x0", "-5x5", "16385x1"})
        EXPECT_EQ(faultOf([&] { parsePictureSize(wrong); }),
                  "'" + std::string(wrong) + "': width and height must be from 1 to 16384");
}

TEST(Values, sizesAreShownAsTheyAreRead) {
    for (const char* text : {"0", "1", "1000", "1k", "1536k", "512M", "1G", "1025M", "3T", "2048T"})
        EXPECT_EQ(formatSize(parseSize(text)), text);
}

}  // namespace
}  // namespace pietra
