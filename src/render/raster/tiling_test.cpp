#include "render/raster/tiling.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>

namespace pietra {
namespace {

constexpr PixelBox kScreen{0, 0, 300, 200};

std::vector<DrawChunk> randomChunks(std::mt19937& random, size_t count, int largest) {
    std::vector<DrawChunk> chunks;
    while (chunks.size() < count) {
        const int32_t x = int32_t(random() % 300), y = int32_t(random() % 200);
        const PixelBox box = PixelBox{x, y, x + 1 + int32_t(random() % unsigned(largest)),
                                      y + 1 + int32_t(random() % unsigned(largest))}
                                 .intersected(kScreen);
        chunks.push_back({nullptr, 0, uint32_t(1 + random() % 5000), box, 0});
    }
    return chunks;
}

TEST(Tiling, PiecesAreDisjointAndTilesHoldEveryPartOfEveryChunk) {
    std::mt19937 random(1);
    for (const size_t count : {1u, 7u, 200u})
        for (const int largest : {1, 20, 300})
            for (const size_t wanted : {1u, 2u, 8u, 50u}) {
                const std::vector<DrawChunk> chunks = randomChunks(random, count, largest);
                const Tiling tiling = makeTiles(chunks, kScreen, wanted);
                const std::vector<DrawTile>& tiles = tiling.tiles;
                EXPECT_LE(tiles.size(), wanted);
                std::vector<int> owner(300 * 200, -1);
                const auto own = [&](const PixelBox& box, int t) {
                    for (int y = box.y0; y < box.y1; ++y)
                        for (int x = box.x0; x < box.x1; ++x) {
                            ASSERT_EQ(owner[y * 300 + x], -1);
                            owner[y * 300 + x] = t;
                        }
                };
                for (size_t t = 0; t < tiles.size(); ++t) own(tiles[t].box, int(t));
                for (const PixelBox& box : tiling.empty) own(box, int(tiles.size()));
                EXPECT_TRUE(std::find(owner.begin(), owner.end(), -1) == owner.end());
                for (uint32_t i = 0; i < chunks.size(); ++i)
                    for (int y = chunks[i].box.y0; y < chunks[i].box.y1; ++y)
                        for (int x = chunks[i].box.x0; x < chunks[i].box.x1; ++x) {
                            const int t = owner[y * 300 + x];
                            ASSERT_LT(t, int(tiles.size()));
                            const std::vector<uint32_t>& listed = tiles[t].chunk;
                            ASSERT_TRUE(std::binary_search(listed.begin(), listed.end(), i));
                        }
            }
}

TEST(Tiling, WorkIsShared) {
    std::mt19937 random(2);
    const std::vector<DrawChunk> chunks = randomChunks(random, 3000, 10);
    const std::vector<DrawTile> tiles = makeTiles(chunks, kScreen, 8).tiles;
    EXPECT_EQ(tiles.size(), 8u);
    for (const DrawTile& tile : tiles) {
        EXPECT_GT(tile.chunk.size(), 200u);
        EXPECT_LT(tile.chunk.size(), 700u);
    }
    EXPECT_TRUE(makeTiles({}, kScreen, 8).tiles.empty());
}

TEST(Tiling, NoTileNeedsALargeBuffer) {
    std::mt19937 random(3);
    std::vector<DrawChunk> chunks;
    for (int i = 0; i < 500; ++i) {
        const int32_t x = int32_t(random() % 3800), y = int32_t(random() % 2100);
        chunks.push_back({nullptr, 0, 1, {x, y, x + 40, y + 40}, 0});
    }
    for (const DrawTile& tile : makeTiles(chunks, {0, 0, 3840, 2160}, 2).tiles)
        EXPECT_LE((tile.box.x1 - tile.box.x0) * (tile.box.y1 - tile.box.y0), 1 << 17);
}

}  // namespace
}  // namespace pietra
