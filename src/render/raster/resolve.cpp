#include "render/raster/resolve.h"

#include <algorithm>
#include <cstring>

#include "render/raster/resolve_kernel.h"

namespace pietra {
namespace {

/// The keys of a chunk's triangles; nothing and what is resolved are outside any chunk.
class KeyRange {
public:
    explicit KeyRange(const DrawChunk& chunk)
        : highest_(lowerWord(chunk.firstNumber())), count_(chunk.count) {}
    bool holds(VisibilityKey key) const { return highest_ - uint32_t(key) < count_; }
    /// Of the patch.
    uint32_t triangle(VisibilityKey key, const DrawChunk& chunk) const {
        return chunk.first + (highest_ - uint32_t(key));
    }

private:
    uint32_t highest_, count_;
};

/// A buffer of items that shades them as many at a time as the shader takes.
class Collector {
public:
    Collector(const BatchPatch& patch, const PixelShader& shader, const VisibilityTile& tile)
        : patch_(patch), shader_(shader), tile_(tile) {}
    ~Collector() { flush(true); }

    /// Where to put up to `count` more items; taken() then says up to where there are some.
    ShadeItem* room(size_t count) {
        if (count_ + count > kCapacity) flush(false);
        return item_ + count_;
    }
    void taken(const ShadeItem* end) { count_ = size_t(end - item_); }

private:
    static constexpr size_t kCapacity = 512;

    /// Shades all items, or only whole vectors of them.
    void flush(bool all) {
        const size_t done = all ? count_ : count_ / kShadeLanes * kShadeLanes;
        shader_.shade(patch_, {item_, done},
                      [&](size_t i, const Rgba8& colour) { put(item_[i], colour); });
        std::memmove(item_, item_ + done, (count_ - done) * sizeof(ShadeItem));
        count_ -= done;
    }
    void put(const ShadeItem& item, const Rgba8& colour) {
        const size_t pixel = tile_.at(item.x(), item.y());
        if (tile_.samples == 1) {
            tile_.colour[pixel] = colour;
            return;
        }
        const uint32_t mask = item.sampleMask();
        for (size_t s = 0; s < 4; ++s)
            if (mask >> s & 1) tile_.colour[4 * pixel + s] = colour;
    }

    const BatchPatch& patch_;
    const PixelShader& shader_;
    const VisibilityTile& tile_;
    size_t count_ = 0;
    ShadeItem item_[kCapacity];
};

constexpr int32_t kRun = 64;  // pixels between two checks for room

void collectOne(const VisibilityTile& tile, const DrawChunk& chunk, Collector& collector, int32_t y,
                int32_t x0, int32_t x1) {
    const auto count = size_t(x1 - x0);
    collector.taken(collectItems(
        tile.key + tile.at(x0, y), count, {chunk.firstNumber(), chunk.first, chunk.count},
        ShadeItem::at(0, x0, y, 1), collector.room(count + kCollectSlack)));
}

/// Each triangle once a pixel, with the mask of its samples.
void collectFour(const VisibilityTile& tile, const DrawChunk& chunk, Collector& collector,
                 int32_t y, int32_t x0, int32_t x1) {
    const KeyRange range(chunk);
    VisibilityKey* key = tile.key + 4 * tile.at(x0, y);
    ShadeItem* item = collector.room(4 * kRun);
    for (int32_t x = x0; x < x1; ++x, key += 4) {
        uint32_t left = 0;
        for (int s = 0; s < 4; ++s) left |= uint32_t(range.holds(key[s])) << s;
        if (left == 0) continue;
        for (int s = 0; s < 4; ++s) {
            uint32_t mask = 0;
            for (int t = s; t < 4; ++t) mask |= uint32_t(uint32_t(key[t]) == uint32_t(key[s])) << t;
            mask &= left;
            const bool first = mask >> s & 1;
            *item = ShadeItem::at(range.triangle(key[s], chunk), x, y, mask);
            item += first;
            if (first) left &= ~mask;
        }
        for (int s = 0; s < 4; ++s) key[s] = range.holds(key[s]) ? key[s] | kResolved : key[s];
    }
    collector.taken(item);
}

}  // namespace

void resolveChunk(const VisibilityTile& tile, const DrawChunk& chunk, const PixelShader& shader) {
    Collector collector(*chunk.patch, shader, tile);
    const PixelBox box = tile.box.intersected(chunk.box);
    const BatchPatch& patch = *chunk.patch;
    prefetchBytes(patch.triangle() + chunk.first, chunk.count * sizeof(Triangle));
    prefetchBytes(patch.vertex, patch.mesh().vertexCount() * sizeof(ScreenVertex));
    const size_t row_bytes = size_t(box.x1 - box.x0) * size_t(tile.samples) * sizeof(VisibilityKey);
    for (int32_t y = box.y0; y < box.y1; ++y) {
        if (y + 1 < box.y1)
            prefetchBytes(tile.key + tile.at(box.x0, y + 1) * size_t(tile.samples), row_bytes);
        for (int32_t x = box.x0; x < box.x1; x += kRun) {
            const int32_t end = std::min(x + kRun, box.x1);
            if (tile.samples == 1)
                collectOne(tile, chunk, collector, y, x, end);
            else
                collectFour(tile, chunk, collector, y, x, end);
        }
    }
}

}  // namespace pietra
