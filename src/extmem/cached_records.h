#pragma once
// Records of one size in a spill, read one by one in an order that often comes back to the same
// places: a cache of 256 blocks of 4 KiB, of which each place has one. The spill must outlive this
// and not change meanwhile. Not thread-safe.

#include <algorithm>
#include <span>
#include <vector>

#include "extmem/spill.h"

namespace pietra {

template <class Record>
class CachedRecords {
public:
    explicit CachedRecords(const Spill& spill) : spill_(&spill) {}

    /// Valid until the next call.
    const Record& operator[](uint64_t i) {
        Block& block = block_[i / kRecords % kBlocks];
        if (block.number != i / kRecords) {
            block.number = i / kRecords;
            const uint64_t first = block.number * kRecords;
            const uint64_t end = spill_->bytes() / sizeof(Record);
            block.record.resize(size_t(std::min<uint64_t>(kRecords, end - first)));
            spill_->read(first * sizeof(Record), std::as_writable_bytes(std::span(block.record)));
        }
        return block.record[i % kRecords];
    }

private:
    static constexpr size_t kRecords = 4096 / sizeof(Record), kBlocks = 256;
    struct Block {
        uint64_t number = ~uint64_t(0);
        std::vector<Record> record;
    };
    const Spill* spill_;
    std::vector<Block> block_{kBlocks};
};

}  // namespace pietra
