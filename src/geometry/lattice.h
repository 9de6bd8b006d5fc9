#pragma once
// The integer lattice on which every position of a model lives (docs/design/lattice.md).
//
// An input position p becomes the integer triple round((p - origin) / step), each in
// [0, kLatticeMax]; equal triples are the same point. Cells of the tetrahedral hierarchy are cut
// from the cube [0, 2^21]^3 of the same lattice. A model may use a coarser sub-lattice: then all
// its vertices are multiples of 2^shift, and `step` stays that of the fine lattice.

#include <cstdint>
#include <glm/common.hpp>

#include "geometry/vec.h"

namespace pietra {

inline constexpr int kLatticeBits = 21;
/// Largest shift, so that rounding to the sub-lattice never leaves the cube.
inline constexpr int kMaxLatticeShift = 10;
inline constexpr int32_t kLatticeMax = (1 << kLatticeBits) - (1 << kMaxLatticeShift);

struct Lattice {
    Vec3d origin{0, 0, 0};  ///< input coordinates of lattice point 0
    double step = 1;        ///< input units per lattice unit
    int shift = 0;          ///< vertices are multiples of 2^shift

    Vec3d toInput(const Vec3i& p) const { return origin + step * Vec3d(p); }
    Vec3d toInput(const Vec3d& p) const { return origin + step * p; }
    /// Real-valued lattice coordinates, not rounded.
    Vec3d toLattice(const Vec3d& p) const { return (p - origin) / step; }
    /// The point that stands for an input position: the nearest multiple of 2^shift, halves upward.
    /// Not clamped to the cube.
    Vec3i snap(const Vec3d& p) const;
    /// The spacing of vertices, in input units.
    double vertexStep() const { return step * double(1 << shift); }
};

/// How fine the lattice is to be.
struct PrecisionSetting {
    enum class Kind { kAuto, kFinest, kStep } kind = Kind::kAuto;
    double step = 0;  ///< kStep: the spacing asked for, in input units
};

/// One 63-bit key a point; the order is by z, then y, then x.
inline uint64_t latticeKey(const Vec3i& p) {
    return uint64_t(uint32_t(p.x)) | uint64_t(uint32_t(p.y)) << kLatticeBits |
           uint64_t(uint32_t(p.z)) << (2 * kLatticeBits);
}

inline Vec3i latticePoint(uint64_t key) {
    constexpr uint64_t mask = (uint64_t(1) << kLatticeBits) - 1;
    return {int32_t(key & mask), int32_t(key >> kLatticeBits & mask),
            int32_t(key >> (2 * kLatticeBits) & mask)};
}

/// Rounds to the nearest multiple of 2^shift, halves upward.
inline int32_t snapToShift(int32_t x, int shift) {
    return shift == 0 ? x : ((x + (1 << (shift - 1))) >> shift) << shift;
}

inline Vec3i snapToShift(const Vec3i& p, int shift) {
    return {snapToShift(p.x, shift), snapToShift(p.y, shift), snapToShift(p.z, shift)};
}

inline Vec3i Lattice::snap(const Vec3d& p) const {
    return snapToShift(Vec3i(glm::floor(toLattice(p) + 0.5)), shift);
}

}  // namespace pietra
