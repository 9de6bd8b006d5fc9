#pragma once
// Which lattice points the vertices of a working mesh occupy: a hash table of vertex ids. A vertex
// that has moved or died is not erased: its entry no longer fits its position, and so never
// matches.

#include <bit>
#include <cstdint>
#include <vector>

#include "base/hash.h"
#include "geometry/lattice.h"
#include "simplify/working_mesh.h"

namespace pietra {

class PositionSet {
public:
    /// Empties it, with room for `capacity` insertions.
    void reset(size_t capacity) {
        const size_t slots = std::bit_ceil(2 * capacity + 16);
        slot_.assign(slots, kEmpty);
        mask_ = slots - 1;
        room_ = slots - slots / 4;
    }

    /// Inserts vertex `v` at its present position. False: no room left; rebuild.
    bool insert(const WorkingMesh& mesh, uint32_t v) {
        if (room_ == 0) return false;
        --room_;
        size_t i = startOf(mesh.point[v].vec());
        while (slot_[i] != kEmpty) i = (i + 1) & mask_;
        slot_[i] = v;
        return true;
    }

    /// True if a living vertex other than `u` and `v` is at `p`.
    bool occupied(const WorkingMesh& mesh, const Vec3f& p, uint32_t u, uint32_t v) const {
        for (size_t i = startOf(p); slot_[i] != kEmpty; i = (i + 1) & mask_) {
            const uint32_t w = slot_[i];
            const Point& q = mesh.point[w];
            if (q.x == p.x && q.y == p.y && q.z == p.z && !q.dead() && w != u && w != v)
                return true;
        }
        return false;
    }

    void prefetch(const Vec3f& p) const { __builtin_prefetch(&slot_[startOf(p)]); }

private:
    static constexpr uint32_t kEmpty = 0xffffffffu;

    size_t startOf(const Vec3f& p) const {
        const uint64_t x = uint32_t(int32_t(p.x)), y = uint32_t(int32_t(p.y)),
                       z = uint32_t(int32_t(p.z));
        return size_t(mixBits(x ^ y << 21 ^ z << 42)) & mask_;
    }

    std::vector<uint32_t> slot_;
    size_t mask_ = 0;
    size_t room_ = 0;
};

}  // namespace pietra
