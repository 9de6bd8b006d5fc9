#pragma once
// Edges by cost, roughly: buckets on the leading bits of the float, two an octave, each a stack in
// chunks. Entries are never deleted; a stale one shows by its stamp. Push and pop take constant
// time.

#include <array>
#include <bit>
#include <cstdint>
#include <vector>

namespace pietra {

class CollapseQueue {
public:
    struct Entry {
        uint32_t u, v;
        uint32_t stamp;  ///< sum of both vertices' stamps: equal only if neither has changed
    };

    void clear() {
        head_.fill(kEnd);
        occupied_.fill(0);
        chunks_.clear();
        free_ = kEnd;
    }

    /// Grows with `cost` >= 0.
    static uint32_t bucketOf(float cost) { return std::bit_cast<uint32_t>(cost) >> kShift; }

    void push(float cost, const Entry& entry) {
        const uint32_t bucket = bucketOf(cost);
        uint32_t& head = head_[bucket];
        if (head == kEnd || chunks_[head].count == kChunkEntries) [[unlikely]]
            addChunk(bucket);
        Chunk& chunk = chunks_[head];
        chunk.entry[chunk.count++] = entry;
    }

    static constexpr uint32_t kNoBucket = 512;

    /// The lowest bucket with entries, or kNoBucket.
    uint32_t lowestBucket() const {
        for (uint32_t word = 0; word < occupied_.size(); ++word)
            if (occupied_[word] != 0)
                return word * 64 + uint32_t(std::countr_zero(occupied_[word]));
        return kNoBucket;
    }

    bool empty(uint32_t bucket) const { return head_[bucket] == kEnd; }

    /// Takes the entry pushed last into `bucket`, which must not be empty.
    Entry pop(uint32_t bucket) {
        Chunk& chunk = chunks_[head_[bucket]];
        const Entry entry = chunk.entry[--chunk.count];
        if (chunk.count == 0) dropChunk(bucket);
        return entry;
    }

private:
    static constexpr uint32_t kEnd = 0xffffffffu;
    static constexpr int kShift = 22;  // leaves the exponent and one bit of the mantissa
    static constexpr uint32_t kChunkEntries = 42;
    struct Chunk {
        uint32_t count;
        uint32_t next;
        Entry entry[kChunkEntries];
    };
    static_assert(sizeof(Chunk) == 512);

    void addChunk(uint32_t bucket) {
        uint32_t index = free_;
        if (index != kEnd) {
            free_ = chunks_[index].next;
        } else {
            index = uint32_t(chunks_.size());
            chunks_.emplace_back();
        }
        chunks_[index].count = 0;
        chunks_[index].next = head_[bucket];
        head_[bucket] = index;
        occupied_[bucket / 64] |= uint64_t(1) << (bucket % 64);
    }

    void dropChunk(uint32_t bucket) {
        const uint32_t index = head_[bucket];
        head_[bucket] = chunks_[index].next;
        if (head_[bucket] == kEnd) occupied_[bucket / 64] &= ~(uint64_t(1) << (bucket % 64));
        chunks_[index].next = free_;
        free_ = index;
    }

    std::array<uint32_t, 512> head_{};
    std::array<uint64_t, 8> occupied_{};
    std::vector<Chunk> chunks_;
    uint32_t free_ = kEnd;
};

}  // namespace pietra
