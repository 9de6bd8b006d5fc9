#include "store/sequences.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

namespace pietra {

namespace {

constexpr uint32_t kEscape = 255;
constexpr int kMaxShift = 24;
constexpr uint64_t kTableBits = 5;  // of zstd's description of a Huffman code, a symbol

size_t packedBytes(size_t count, int shift) {
    return (count * size_t(shift) + 7) / 8;
}

/// log2 of x > 0 in 1/256 bits, to about 1/20 bit: the bytes of a page must not depend on libm.
uint64_t log2Fixed(uint64_t x) {
    const int whole = int(std::bit_width(x)) - 1;
    const uint64_t fraction = ((x << 8) >> whole) - 256;  // linear between powers of two
    return uint64_t(whole) * 256 + fraction;
}

/// What the numbers of a histogram (of numbers >> shift) cost about, in 1/256 bits: Huffman codes
/// for the symbols and the table that describes these, low bits, escapes.
uint64_t estimateCost(std::span<const uint32_t> histogram, uint64_t total, uint64_t beyond,
                      int shift) {
    uint64_t cost = (uint64_t(shift) * total + 40 * beyond) * 256;
    uint64_t escaped = beyond;
    for (size_t symbol = 0; symbol < histogram.size(); ++symbol) {
        const uint64_t count = histogram[symbol];
        if (count == 0) continue;
        if (symbol >= kEscape) {
            escaped += count;
            cost += 40 * count * 256;
            continue;
        }
        cost += count * (log2Fixed(total) - log2Fixed(count)) + kTableBits * 256;
    }
    if (escaped > 0) cost += escaped * (log2Fixed(total) - log2Fixed(escaped));
    return cost;
}

int chooseShift(std::span<const uint32_t> numbers) {
    if (numbers.empty()) return 0;
    uint64_t sum = 0;
    for (const uint32_t number : numbers) sum += number;
    // From clearly too fine upward, halving the histogram each time.
    int shift = std::clamp(int(std::bit_width(sum / numbers.size())) - 5, 0, kMaxShift);
    std::array<uint32_t, 512> histogram{};
    uint64_t beyond = 0;
    for (const uint32_t number : numbers) {
        const uint32_t symbol = number >> shift;
        if (symbol < histogram.size())
            ++histogram[symbol];
        else
            ++beyond;
    }
    size_t bins = histogram.size();
    while (bins > 1 && histogram[bins - 1] == 0) --bins;
    int best = shift;
    uint64_t least = ~uint64_t(0);
    for (; shift <= kMaxShift; ++shift) {
        const uint64_t cost =
            estimateCost(std::span(histogram).first(bins), numbers.size(), beyond, shift);
        if (cost >= least) break;
        least = cost;
        best = shift;
        bins = (bins + 1) / 2;
        for (size_t i = 0; i < bins; ++i) histogram[i] = histogram[2 * i] + histogram[2 * i + 1];
        for (size_t i = bins; i < 2 * bins; ++i) histogram[i] = 0;
    }
    return best;
}

void writeOne(std::span<const uint32_t> numbers, int shift, StreamPacker& packer,
              std::vector<uint8_t>& escapes) {
    std::vector<uint8_t>& symbols = packer.add();
    symbols.resize(numbers.size());
    for (size_t i = 0; i < numbers.size(); ++i) {
        const uint32_t symbol = numbers[i] >> shift;
        symbols[i] = uint8_t(std::min(symbol, kEscape));
        if (symbol < kEscape) continue;
        for (int byte = 0; byte < 4; ++byte) escapes.push_back(uint8_t(numbers[i] >> (8 * byte)));
    }
    if (shift == 0) return;
    std::vector<uint8_t>& low = packer.add();
    low.assign(packedBytes(numbers.size(), shift), 0);
    const uint32_t mask = (1u << shift) - 1;
    uint64_t bits = 0;
    int held = 0;
    size_t at = 0;
    for (const uint32_t number : numbers) {
        bits |= uint64_t(number & mask) << held;
        for (held += shift; held >= 8; held -= 8, bits >>= 8) low[at++] = uint8_t(bits);
    }
    if (held > 0) low[at] = uint8_t(bits);
}

/// Joins symbols and low bits; `escapes` loses those it used. False if there are too few.
bool readOne(const StreamUnpacker& streams, size_t first, int shift,
             std::span<const uint8_t>& escapes, std::vector<uint32_t>& numbers) {
    const std::span<const uint8_t> symbols = streams[first];
    const size_t n = symbols.size();
    numbers.resize(n);
    uint32_t* out = numbers.data();
    const uint8_t* in = symbols.data();
    uint8_t largest = 0;
    for (size_t i = 0; i < n; ++i) {
        out[i] = uint32_t(in[i]) << shift;
        largest = std::max(largest, in[i]);
    }
    if (shift > 0) {
        const std::span<const uint8_t> low = streams[first + 1];
        if (low.size() != packedBytes(n, shift)) return false;
        const uint32_t mask = (1u << shift) - 1;
        for (size_t i = 0, bit = 0; i < n; ++i, bit += size_t(shift)) {
            uint32_t word;  // may reach into the next stream, or into kSlack behind the last
            std::memcpy(&word, low.data() + (bit >> 3), sizeof word);
            out[i] |= word >> (bit & 7) & mask;
        }
    }
    if (largest < kEscape) return true;
    for (size_t i = 0; i < n; ++i) {
        if (in[i] != kEscape) continue;
        if (escapes.size() < 4) return false;
        std::memcpy(&out[i], escapes.data(), 4);
        escapes = escapes.subspan(4);
    }
    return true;
}

}  // namespace

void writeSequences(std::span<const std::vector<uint32_t>> sequences, StreamPacker& packer,
                    ByteWriter& writer) {
    packer.clear();
    std::vector<uint8_t> escapes;
    for (const std::vector<uint32_t>& numbers : sequences) {
        const int shift = chooseShift(numbers);
        writer.fixed(uint8_t(shift));
        writeOne(numbers, shift, packer, escapes);
    }
    packer.add() = escapes;
    packer.write(writer);
}

bool readSequences(ByteReader& reader, uint64_t most, StreamUnpacker& unpacker,
                   std::span<std::vector<uint32_t>> sequences, std::string& fault) {
    std::vector<int> shifts;
    size_t streams = 1;
    for (size_t i = 0; i < sequences.size(); ++i) {
        shifts.push_back(reader.fixed<uint8_t>());
        if (shifts.back() > kMaxShift) {
            fault = "a sequence has an impossible shift";
            return false;
        }
        streams += shifts.back() > 0 ? 2 : 1;
    }
    // A number takes a symbol, up to three bytes of low bits, or an escape.
    if (!unpacker.read(reader, streams, 4 * most, 5 * most, fault)) return false;
    std::span<const uint8_t> escapes = unpacker[streams - 1];
    size_t stream = 0;
    bool good = true;
    for (size_t i = 0; i < sequences.size() && good; ++i) {
        good = readOne(unpacker, stream, shifts[i], escapes, sequences[i]);
        stream += shifts[i] > 0 ? 2 : 1;
    }
    if (!good || !escapes.empty()) fault = "its sequences do not fit together";
    return good && escapes.empty();
}

}  // namespace pietra
