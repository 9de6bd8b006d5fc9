#pragma once
// Pages: several patches (small meshes) as one run of compressed bytes. FORMAT.md has the layout.
//
// What survives: positions and colours, scalars, edge classes and connectivity exactly; normals
// rounded to `normal_bits` a component. Vertices and triangles may come back in another order,
// which suits the vertex cache, and triangles rotated (winding kept, edge classes follow).
//
// Pure functions, thread-safe; the same patches always give the same bytes. Both keep scratch
// memory per thread, about the size of the largest page seen.

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace pietra {

/// What all pages of a model have in common. `shift` and `normal_bits` are written into the page,
/// so a decoder needs only the rest.
struct PageSettings {
    int shift = 0;  ///< all positions are multiples of 2^shift, lattice units
    bool colours = false;
    int scalar_count = 0;
    int normal_bits = 10;  ///< per octahedral component, kMinNormalBits to kMaxNormalBits
};

inline constexpr int kMinNormalBits = 4;
inline constexpr int kMaxNormalBits = 16;  ///< loses nothing
inline constexpr int kMaxScalars = 255;
/// A page has at most this many patches, vertices and triangles: what bounds a decoder's memory.
inline constexpr uint32_t kMaxPagePatches = 1 << 16;
inline constexpr uint32_t kMaxPageTriangles = 1 << 22;
inline constexpr uint32_t kMaxPageVertices = 3 << 22;

/// Which body a page has. kBest tries the smaller ones first and falls back to kPlain, which takes
/// every mesh.
enum class PageCodec : uint8_t { kPlain = 0, kFront = 1, kBest = 255 };

/// Patches may be empty, and have vertices that no triangle uses. CHECKs that positions lie on the
/// lattice (0 to kLatticeMax, multiples of 2^shift) and that every array has its length.
std::vector<std::byte> encodePage(std::span<const Mesh* const> patches,
                                  const PageSettings& settings, PageCodec codec = PageCodec::kBest);

/// What a page says it holds, before anything is allocated for it.
struct PageCounts {
    uint32_t patches = 0;
    uint64_t vertices = 0;
    uint64_t triangles = 0;
};

/// Both take untrusted bytes: they return false with a sentence in `fault`, never throw on account
/// of the bytes, and never read or write out of range. decodePage overwrites `patches`, keeping
/// their capacity; after a failure its content is unspecified. Memory: at most what peekPage's
/// counts need.
[[nodiscard]] bool peekPage(std::span<const std::byte> bytes, PageCounts& counts,
                            std::string& fault);
[[nodiscard]] bool decodePage(std::span<const std::byte> bytes, const PageSettings& settings,
                              std::vector<Mesh>& patches, std::string& fault);

/// The octahedral component as the page keeps it, and back: |code| < 2^(bits-1). Integer
/// arithmetic.
inline int32_t quantiseNormal(int32_t component, int bits) {
    const int32_t top = (1 << (bits - 1)) - 1;
    const int32_t scaled = component * top * 2;
    const int32_t half = component < 0 ? -32767 : 32767;
    return (scaled + half) / (2 * 32767);
}
inline int32_t restoreNormal(int32_t code, int bits) {
    const int32_t top = (1 << (bits - 1)) - 1;
    const int32_t half = code < 0 ? -top : top;
    return (code * 32767 * 2 + half) / (2 * top);
}

}  // namespace pietra
