#pragma once
// Sequences of 32-bit numbers, most of them small, as byte streams for zstd's Huffman stage. Each
// has a shift k: number = symbol << k | low. The symbols are one stream, bytes 0 to 254, where 255
// stands for a number that is kept whole in the stream of escapes, shared by all sequences; the low
// k bits are byte planes. FORMAT.md, "Sequences". Internal to src/store.

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "store/page_format.h"

namespace pietra {

/// Writes all sequences: their number is fixed by the body, so it is not stored.
void writeSequences(std::span<const std::vector<uint32_t>> sequences, StreamPacker& packer,
                    ByteWriter& writer);

/// Reads `sequences.size()` sequences. `most`: an upper bound of how many numbers there are in all,
/// as the page's counts justify. Untrusted bytes.
[[nodiscard]] bool readSequences(ByteReader& reader, uint64_t most, StreamUnpacker& unpacker,
                                 std::span<std::vector<uint32_t>> sequences, std::string& fault);

}  // namespace pietra
