#include "render/gl/arena.h"

#include <bit>
#include <limits>

#include "base/check.h"

namespace pietra {

ArenaAllocator::ArenaAllocator(size_t bytes) : granules_(uint32_t(bytes / kArenaGranule)) {
    CHECK_LE(bytes / kArenaGranule, size_t(std::numeric_limits<uint32_t>::max() - 1));
    first_.fill(kNone);
    if (granules_ == 0) return;
    insertFree(newNode({0, granules_, kNone, kNone, kNone, kNone, false}));
}

/// Sizes below 8 have a bin each; above, the three bits below the leading one tell.
uint32_t ArenaAllocator::binOf(uint32_t size) {
    if (size < 8) return size;
    const auto log = uint32_t(std::bit_width(size)) - 1;
    return (log - 2) * 8 + (size >> (log - 3) & 7);
}

uint32_t ArenaAllocator::firstBinFrom(uint32_t bin) const {
    for (uint32_t word = bin / 64; word < occupied_.size(); ++word) {
        uint64_t bits = occupied_[word];
        if (word == bin / 64) bits &= ~uint64_t(0) << (bin % 64);
        if (bits != 0) return word * 64 + uint32_t(std::countr_zero(bits));
    }
    return kNone;
}

uint32_t ArenaAllocator::findFree(uint32_t size) const {
    // All blocks of the bins above are large enough.
    const uint32_t own = binOf(size), bin = firstBinFrom(own + 1);
    if (bin != kNone) return first_[bin];
    for (uint32_t node = first_[own]; node != kNone; node = nodes_[node].bin_next)
        if (nodes_[node].size >= size) return node;
    return kNone;
}

uint32_t ArenaAllocator::newNode(const Node& node) {
    if (unused_nodes_.empty()) {
        nodes_.push_back(node);
        return uint32_t(nodes_.size() - 1);
    }
    const uint32_t index = unused_nodes_.back();
    unused_nodes_.pop_back();
    nodes_[index] = node;
    return index;
}

void ArenaAllocator::insertFree(uint32_t index) {
    Node& node = nodes_[index];
    const uint32_t bin = binOf(node.size);
    node.used = false;
    node.bin_previous = kNone;
    node.bin_next = first_[bin];
    if (node.bin_next != kNone) nodes_[node.bin_next].bin_previous = index;
    first_[bin] = index;
    occupied_[bin / 64] |= uint64_t(1) << (bin % 64);
}

void ArenaAllocator::removeFree(uint32_t index) {
    const Node& node = nodes_[index];
    const uint32_t bin = binOf(node.size);
    if (node.bin_next != kNone) nodes_[node.bin_next].bin_previous = node.bin_previous;
    if (node.bin_previous != kNone)
        nodes_[node.bin_previous].bin_next = node.bin_next;
    else
        first_[bin] = node.bin_next;
    if (first_[bin] == kNone) occupied_[bin / 64] &= ~(uint64_t(1) << (bin % 64));
}

void ArenaAllocator::split(uint32_t index, uint32_t size) {
    const Node node = nodes_[index];
    if (node.size == size) return;
    const uint32_t rest =
        newNode({node.begin + size, node.size - size, index, node.next, kNone, kNone, false});
    nodes_[index].size = size;
    nodes_[index].next = rest;
    if (node.next != kNone) nodes_[node.next].previous = rest;
    insertFree(rest);
}

void ArenaAllocator::swallowNext(uint32_t index) {
    Node& node = nodes_[index];
    const uint32_t gone = node.next;
    node.size += nodes_[gone].size;
    node.next = nodes_[gone].next;
    if (node.next != kNone) nodes_[node.next].previous = index;
    unused_nodes_.push_back(gone);
}

std::optional<ArenaBlock> ArenaAllocator::allocate(size_t bytes) {
    CHECK_LT(size_t(0), bytes);
    const size_t granules = bytes / kArenaGranule + (bytes % kArenaGranule != 0);
    if (granules > granules_) return std::nullopt;
    const auto size = uint32_t(granules);
    const uint32_t index = findFree(size);
    if (index == kNone) return std::nullopt;
    removeFree(index);
    split(index, size);
    nodes_[index].used = true;
    used_ += size;
    return ArenaBlock{size_t(nodes_[index].begin) * kArenaGranule, size_t(size) * kArenaGranule,
                      index};
}

void ArenaAllocator::free(const ArenaBlock& block) {
    uint32_t index = block.node;
    CHECK_LT(size_t(index), nodes_.size());
    CHECK(nodes_[index].used && size_t(nodes_[index].begin) * kArenaGranule == block.offset);
    used_ -= nodes_[index].size;
    const uint32_t next = nodes_[index].next, previous = nodes_[index].previous;
    if (next != kNone && !nodes_[next].used) {
        removeFree(next);
        swallowNext(index);
    }
    if (previous != kNone && !nodes_[previous].used) {
        removeFree(previous);
        nodes_[index].used = false;
        index = previous;
        swallowNext(index);
    }
    insertFree(index);
}

}  // namespace pietra
