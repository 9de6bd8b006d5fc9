#pragma once
// Where things lie in a buffer of fixed size: a two-level segregated-fit allocator (Masmano et al.
// 2004) of offsets. It never touches the memory itself, which is the GPU's.
//
// Free blocks are kept in bins, eight for each power of two of their size, and neighbours that are
// free are always merged. Both operations take constant time, but where only blocks of the very bin
// of the size asked for may serve: that bin is then searched, so that allocate() fails only if no
// free block is large enough. Not thread-safe.

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

namespace pietra {

/// A part of the arena, as long as it is not freed.
struct ArenaBlock {
    size_t offset = 0;  ///< in bytes, a multiple of kArenaGranule
    size_t bytes = 0;   ///< what was asked for, rounded up to granules
    uint32_t node = 0;  ///< the allocator's own
};

inline constexpr size_t kArenaGranule = 64;

class ArenaAllocator {
public:
    /// Less than 2^32 granules; what is left over by whole granules is not used.
    explicit ArenaAllocator(size_t bytes);

    /// `bytes` > 0.
    std::optional<ArenaBlock> allocate(size_t bytes);
    /// A block of allocate(), once.
    void free(const ArenaBlock& block);

    size_t capacity() const { return size_t(granules_) * kArenaGranule; }
    size_t used() const { return size_t(used_) * kArenaGranule; }

private:
    static constexpr uint32_t kNone = ~0u;
    static constexpr uint32_t kBins = 32 * 8;

    /// A block, free or used, in a list by address; free ones also in the list of their bin.
    struct Node {
        uint32_t begin, size;  // in granules
        uint32_t previous, next;
        uint32_t bin_previous, bin_next;
        bool used;
    };

    static uint32_t binOf(uint32_t size);
    uint32_t findFree(uint32_t size) const;
    uint32_t firstBinFrom(uint32_t bin) const;
    uint32_t newNode(const Node& node);
    void insertFree(uint32_t node);
    void removeFree(uint32_t node);
    /// Takes the rest of a block beyond `size` off it, as a free block.
    void split(uint32_t node, uint32_t size);
    /// Appends the next block, which is forgotten, to `node`.
    void swallowNext(uint32_t node);

    uint32_t granules_, used_ = 0;
    std::vector<Node> nodes_;
    std::vector<uint32_t> unused_nodes_;
    std::array<uint32_t, kBins> first_;
    std::array<uint64_t, kBins / 64> occupied_{};  // a bit for each bin
};

}  // namespace pietra
