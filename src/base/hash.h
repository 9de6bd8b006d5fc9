#pragma once
// Hashes: XXH3 for content, a mixer for keys. Both are part of the file format: never change them.

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <cstddef>
#include <cstdint>

namespace pietra {

inline uint64_t hashBytes(const void* data, size_t bytes, uint64_t seed = 0) {
    return XXH3_64bits_withSeed(data, bytes, seed);
}

/// A bijection of 64 bits that mixes well (the finaliser of SplitMix64).
inline uint64_t mixBits(uint64_t x) {
    x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9ULL;
    x = (x ^ (x >> 27)) * 0x94d049bb133111ebULL;
    return x ^ (x >> 31);
}

}  // namespace pietra
