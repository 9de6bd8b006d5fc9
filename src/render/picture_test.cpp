#include "render/picture.h"

#include <gtest/gtest.h>
#include <zlib.h>

#include <cmath>
#include <fstream>
#include <limits>

#include "base/error.h"
#include "base/scratch_directory.h"
#include "render/shading.h"

namespace pietra {
namespace {

constexpr float kNothing = std::numeric_limits<float>::infinity();

class PictureFile : public testing::Test {
protected:
    std::string path(const std::string& name) const { return scratch_.file(name); }
    std::string bytes(const std::string& name) const {
        std::ifstream in(path(name), std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }
    void put(const std::string& name, const std::string& bytes) const {
        scratch_.write(name, bytes);
    }

private:
    const ScratchDirectory scratch_;
};

Picture sample(int width, int height) {
    Picture picture;
    picture.size = {width, height};
    picture.focal_px = 1234.5678;
    for (int y = 0; y < height; ++y)
        for (int x = 0; x < width; ++x) {
            picture.colour.push_back({uint8_t(x), uint8_t(y), uint8_t(x * y), 255});
            picture.depth.push_back((x + y) % 7 == 0 ? kNothing
                                                     : 10 + 0.1f * float(x) / float(y + 1));
        }
    return picture;
}

TEST_F(PictureFile, RoundTripKeepsColourAndDepth) {
    for (const PictureSize size : {PictureSize{33, 21}, {1, 1}, {1, 50}, {50, 1}}) {
        const Picture picture = sample(size.width, size.height);
        writePng(picture, path("a.png"), true);
        const Picture back = readPicture(path("a.png"));
        EXPECT_EQ(back.size.width, size.width);
        EXPECT_EQ(back.size.height, size.height);
        EXPECT_EQ(back.colour, picture.colour);
        EXPECT_EQ(back.depth, picture.depth);
        EXPECT_EQ(back.focal_px, picture.focal_px);
    }
}

TEST_F(PictureFile, WithoutDepthIsAnOrdinaryPng) {
    Picture picture = sample(10, 10);
    picture.depth.clear();
    writePng(picture, path("a.png"), false);
    EXPECT_EQ(bytes("a.png").find("piDZ"), std::string::npos);
    EXPECT_FALSE(readPicture(path("a.png")).hasDepth());
    EXPECT_THROW(writePng(picture, path("a.png"), false), UsageError);
}

TEST_F(PictureFile, EveryTruncationAndEveryFlippedByteOfTheDepthIsRefused) {
    writePng(sample(9, 7), path("good.png"), false);
    const std::string good = bytes("good.png");
    for (size_t length = 0; length < good.size(); ++length) {
        put("bad.png", good.substr(0, length));
        EXPECT_THROW(readPicture(path("bad.png")), InputError) << length;
    }
    const size_t chunk = good.find("piDZ");
    ASSERT_NE(chunk, std::string::npos);
    for (size_t i = chunk + 4; i < good.size() - 12; ++i) {
        std::string bad = good;
        bad[i] = char(bad[i] ^ 0x20);
        put("bad.png", bad);
        EXPECT_THROW(readPicture(path("bad.png")), InputError) << i;
    }
}

TEST_F(PictureFile, MessagesNameTheFileAndThePlace) {
    put("text.png", "this is no picture, but long enough to be one");
    try {
        readPicture(path("text.png"));
        FAIL();
    } catch (const InputError& error) {
        EXPECT_EQ(std::string(error.what()).find(path("text.png") + ": not a readable PNG: "), 0u)
            << error.what();
    }
    writePng(sample(9, 7), path("good.png"), false);
    std::string bad = bytes("good.png");
    const size_t chunk = bad.find("piDZ");
    bad[chunk + 30] = char(bad[chunk + 30] ^ 1);
    put("bad.png", bad);
    try {
        readPicture(path("bad.png"));
        FAIL();
    } catch (const InputError& error) {
        EXPECT_EQ(std::string(error.what()), path("bad.png") + ": byte " +
                                                 std::to_string(chunk - 4) +
                                                 ": the depth chunk has a wrong checksum");
    }
    EXPECT_THROW(readPicture(path("absent.png")), IoError);
    // A header that promises far more than there is.
    bad = bytes("good.png");
    bad[18] = bad[22] = 0x30;
    const auto crc = uint32_t(crc32(0, reinterpret_cast<const Bytef*>(bad.data()) + 12, 17));
    for (int k = 0; k < 4; ++k) bad[size_t(29 + k)] = char(crc >> (24 - 8 * k));
    put("bad.png", bad);
    try {
        readPicture(path("bad.png"));
        FAIL();
    } catch (const InputError& error) {
        EXPECT_EQ(
            std::string(error.what()),
            path("bad.png") + ": byte " + std::to_string(bad.size()) + ": the PNG ends early");
    }
}

TEST(Shading, SrgbIsTheStandardAndBytesComeBack) {
    for (int i = 0; i <= 1000; ++i) {
        const double x = i / 1000.0;
        const double encoded = x <= 0.0031308 ? 12.92 * x : 1.055 * std::pow(x, 1 / 2.4) - 0.055;
        const double decoded = x <= 0.04045 ? x / 12.92 : std::pow((x + 0.055) / 1.055, 2.4);
        EXPECT_NEAR(srgbFromLinear(float(x)), encoded * 255, 0.75) << x;
        EXPECT_NEAR(linearFromSrgb(float(x)), decoded, 1e-6) << x;
    }
    EXPECT_EQ(srgbFromLinear(Vec3f(-1, 1, 2)), (Rgba8{0, 255, 255, 255}));
    EXPECT_EQ(srgbFromLinear(std::numeric_limits<float>::quiet_NaN()), 0);
    for (int i = 0; i < 256; ++i) EXPECT_EQ(srgbFromLinear(linearFromSrgb(uint8_t(i))), i);
}

TEST(Shading, LevelsAndPatchesDiffer) {
    for (int level = 0; level < 12; ++level)
        EXPECT_GT(glm::length(levelColour(float(level)) - levelColour(float(level + 1))), 0.2f)
            << level;
    EXPECT_NE(hashColour(1), hashColour(2));
    EXPECT_EQ(hashColour(7), hashColour(7));
}

}  // namespace
}  // namespace pietra
