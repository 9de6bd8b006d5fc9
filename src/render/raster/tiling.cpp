#include "render/raster/tiling.h"

#include <algorithm>
#include <optional>
#include <utility>

namespace pietra {
namespace {

/// Cuts are at multiples of this, so that no two threads share a cache line of the picture.
constexpr int32_t kAlign = 16;
constexpr int32_t kMinSide = 32;
/// A tile with less work (in triangles) is not worth the cut.
constexpr uint64_t kMinWork = 1000;
constexpr uint64_t kPixelsPerTriangle = 8;  // that cost as much
/// Every thread keeps a buffer for the largest tile it has drawn, 12 bytes a sample.
constexpr uint64_t kMostPixels = uint64_t(1) << 17;

uint64_t area(const PixelBox& box) {
    return uint64_t(box.x1 - box.x0) * uint64_t(box.y1 - box.y0);
}

/// The share of a chunk's work that falls into a box it touches.
uint64_t workIn(const DrawChunk& chunk, const PixelBox& box) {
    const uint64_t part = area(chunk.box.intersected(box)), whole = area(chunk.box);
    return uint64_t(chunk.count) * part / whole + part / kPixelsPerTriangle;
}

/// What is left of a box beside one within it.
void addMargins(const PixelBox& box, const PixelBox& inner, std::vector<PixelBox>& margins) {
    for (const PixelBox& margin :
         {PixelBox{box.x0, box.y0, box.x1, inner.y0}, PixelBox{box.x0, inner.y1, box.x1, box.y1},
          PixelBox{box.x0, inner.y0, inner.x0, inner.y1},
          PixelBox{inner.x1, inner.y0, box.x1, inner.y1}})
        if (!margin.empty()) margins.push_back(margin);
}

class Cutter {
public:
    explicit Cutter(std::span<const DrawChunk> chunks) : chunks_(chunks) {}

    DrawTile makeTile(const PixelBox& box, std::span<const uint32_t> candidates) const {
        DrawTile tile;
        PixelBox used{box.x1, box.y1, box.x0, box.y0};
        for (const uint32_t i : candidates) {
            const PixelBox part = chunks_[i].box.intersected(box);
            if (part.empty()) continue;
            tile.chunk.push_back(i);
            used = {std::min(used.x0, part.x0), std::min(used.y0, part.y0),
                    std::max(used.x1, part.x1), std::max(used.y1, part.y1)};
        }
        tile.box = used;
        return tile;
    }

    uint64_t work(const DrawTile& tile) const {
        uint64_t sum = 0;
        for (const uint32_t i : tile.chunk) sum += workIn(chunks_[i], tile.box);
        return sum;
    }

    struct Halves {
        PixelBox low_box, high_box;
        DrawTile low, high;  ///< what of these has chunks
    };
    /// Halves the work across the longer side; nothing if the tile is too small.
    std::optional<Halves> cut(const DrawTile& tile) const {
        const bool across_x = tile.box.x1 - tile.box.x0 > tile.box.y1 - tile.box.y0;
        const int32_t at = across_x ? cutPosition(tile, &PixelBox::x0, &PixelBox::x1)
                                    : cutPosition(tile, &PixelBox::y0, &PixelBox::y1);
        Halves halves{tile.box, tile.box, {}, {}};
        (across_x ? halves.low_box.x1 : halves.low_box.y1) = at;
        (across_x ? halves.high_box.x0 : halves.high_box.y0) = at;
        if (halves.low_box.empty() || halves.high_box.empty()) return {};
        halves.low = makeTile(halves.low_box, tile.chunk);
        halves.high = makeTile(halves.high_box, tile.chunk);
        if (halves.low.chunk.empty() || halves.high.chunk.empty()) return {};
        return halves;
    }

private:
    using Side = int32_t PixelBox::*;

    int32_t cutPosition(const DrawTile& tile, Side from, Side to) const {
        std::vector<std::pair<int32_t, uint64_t>> centres;
        uint64_t total = 0;
        for (const uint32_t i : tile.chunk) {
            const PixelBox part = chunks_[i].box.intersected(tile.box);
            const uint64_t work = workIn(chunks_[i], tile.box);
            centres.emplace_back((part.*from + part.*to) / 2, work);
            total += work;
        }
        std::sort(centres.begin(), centres.end());
        uint64_t below = 0;
        int32_t at = tile.box.*from;
        for (const auto& [centre, work] : centres) {
            if (2 * below >= total) break;
            at = centre;
            below += work;
        }
        at = (at + kAlign / 2) / kAlign * kAlign;
        if (tile.box.*to - tile.box.*from < 2 * kMinSide) return tile.box.*from;
        return std::clamp(at, tile.box.*from + kMinSide, tile.box.*to - kMinSide);
    }

    std::span<const DrawChunk> chunks_;
};

}  // namespace

Tiling makeTiles(std::span<const DrawChunk> chunks, const PixelBox& screen, size_t tiles) {
    const Cutter cutter(chunks);
    Tiling tiling;
    std::vector<uint32_t> all(chunks.size());
    for (size_t i = 0; i < all.size(); ++i) all[i] = uint32_t(i);
    struct Entry {
        uint64_t work;
        DrawTile tile;
        bool operator<(const Entry& other) const { return work < other.work; }
    };
    // A heap with the costliest tile on top: cut it until there are enough, and none is too large.
    std::vector<Entry> heap;
    const auto add = [&](DrawTile tile, const PixelBox& around) {
        addMargins(around, tile.box, tiling.empty);
        const uint64_t work = cutter.work(tile);
        heap.push_back({work, std::move(tile)});
        std::push_heap(heap.begin(), heap.end());
    };
    DrawTile whole = cutter.makeTile(screen, all);
    if (whole.chunk.empty()) return {{}, {screen}};
    add(std::move(whole), screen);
    std::vector<DrawTile>& done = tiling.tiles;
    while (!heap.empty()) {
        const bool enough = heap.size() + done.size() >= tiles || heap.front().work <= kMinWork;
        std::pop_heap(heap.begin(), heap.end());
        DrawTile tile = std::move(heap.back().tile);
        heap.pop_back();
        std::optional<Cutter::Halves> halves;
        if (!enough || area(tile.box) > kMostPixels) halves = cutter.cut(tile);
        if (halves) {
            add(std::move(halves->low), halves->low_box);
            add(std::move(halves->high), halves->high_box);
        } else {
            done.push_back(std::move(tile));
        }
    }
    return tiling;
}

}  // namespace pietra
