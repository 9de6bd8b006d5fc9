#pragma once
// Edges by cost, roughly: buckets on the leading bits of the float, two an octave, each a stack.
// Entries are never deleted; a stale one shows by its stamp. Push and pop take constant time.

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
        uint32_t next;
    };

    void clear() {
        head_.fill(kEnd);
        occupied_.fill(0);
        entries_.clear();
        free_ = kEnd;
    }

    /// `cost` >= 0.
    void push(float cost, uint32_t u, uint32_t v, uint32_t stamp) {
        const uint32_t bucket = std::bit_cast<uint32_t>(cost) >> kShift;
        uint32_t index = free_;
        if (index != kEnd) {
            free_ = entries_[index].next;
        } else {
            index = uint32_t(entries_.size());
            entries_.emplace_back();
        }
        entries_[index] = {u, v, stamp, head_[bucket]};
        head_[bucket] = index;
        occupied_[bucket / 64] |= uint64_t(1) << (bucket % 64);
    }

    /// Takes up to `room` entries of the lowest bucket, those pushed last first. 0: empty.
    uint32_t popBatch(Entry* entries, uint32_t room) {
        for (uint32_t word = 0; word < occupied_.size(); ++word) {
            if (occupied_[word] == 0) continue;
            const uint32_t bucket = word * 64 + uint32_t(std::countr_zero(occupied_[word]));
            uint32_t index = head_[bucket], count = 0;
            for (; index != kEnd && count < room; ++count) {
                entries[count] = entries_[index];
                entries_[index].next = free_;
                free_ = index;
                index = entries[count].next;
            }
            head_[bucket] = index;
            if (index == kEnd) occupied_[word] &= occupied_[word] - 1;
            return count;
        }
        return 0;
    }

private:
    static constexpr uint32_t kEnd = 0xffffffffu;
    static constexpr int kShift = 22;  // leaves the exponent and one bit of the mantissa
    std::array<uint32_t, 512> head_{};
    std::array<uint64_t, 8> occupied_{};
    std::vector<Entry> entries_;
    uint32_t free_ = kEnd;
};

}  // namespace pietra
