#pragma once
// The mesh while it is being simplified: arrays indexed by the input's vertices and triangles, and
// for each vertex its fan, the list of its corners. Nothing is compacted before the end; dead
// corners are dropped from a fan when it is next read.

#include <array>
#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"
#include "simplify/quadric.h"

namespace pietra {

/// How freely a vertex may move; it may only be merged into one of equal or higher rank.
enum VertexRank : uint32_t {
    kRankFree = 0,
    kRankCurve = 1,  ///< on a border of the input or on a curve where three sheets meet
    kRankFixed = 2,  ///< on the diamond's outer border, or where curves end or meet
};

inline constexpr uint32_t kRankMask = 3;
/// On the diamond's outer border: some of its edges are used elsewhere too.
inline constexpr uint32_t kOuterFlag = 4;
inline constexpr uint32_t kDeadFlag = 8;
/// Its fan was not one of plain, consistently oriented manifold edges.
inline constexpr uint32_t kIrregularFlag = 16;

/// Coordinates relative to the mesh's centre: integers below 2^21, hence exact.
struct alignas(16) Point {
    float x, y, z;
    uint32_t flags;

    Vec3f vec() const { return {x, y, z}; }
    uint32_t rank() const { return flags & kRankMask; }
    bool outer() const { return (flags & kOuterFlag) != 0; }
    bool dead() const { return (flags & kDeadFlag) != 0; }
};

struct alignas(16) Face {
    uint32_t v[3];
    uint32_t meta;  ///< bits 0-7 cell, 8-13 edge classes, 31 dead

    uint32_t cell() const { return meta & 0xff; }
    uint32_t classes() const { return meta >> 8 & 0x3f; }
    EdgeClass edgeClass(uint32_t edge) const { return EdgeClass(meta >> (8 + 2 * edge) & 3); }
    void setEdgeClass(uint32_t edge, EdgeClass c) {
        meta = (meta & ~(3u << (8 + 2 * edge))) | uint32_t(c) << (8 + 2 * edge);
    }
    bool dead() const { return (meta >> 31) != 0; }
};

/// corner = 4 * face + k.
inline constexpr uint32_t kNextCorner[4] = {1, 2, 0, 0};
inline constexpr uint32_t kPreviousCorner[4] = {2, 0, 1, 0};

struct Fan {
    uint32_t begin;  ///< into WorkingMesh::corner
    uint32_t count;
};

struct WorkingMesh {
    /// Sets everything but ranks, outer flags and quadrics.
    void load(const Mesh& in, std::span<const uint8_t> cell, std::span<const uint32_t> quota);

    Vec3i centre{0, 0, 0};
    std::vector<Point> point;
    std::vector<Quadric> quadric;
    std::vector<Fan> fan;
    std::vector<Face> face;
    std::vector<uint32_t> corner;  ///< arena of the fans; corner.size() is its capacity
    uint32_t corner_end = 0;
    std::vector<uint32_t> stamp;  ///< one a vertex: changes when it moves or dies
    std::vector<uint32_t> mark;   ///< one a vertex: scratch of the walks, compared with `epoch`
    uint32_t epoch = 0;
    std::vector<uint32_t> parent;  ///< the vertex it was merged into, or itself

    std::array<uint32_t, 256> cell_count{};
    std::array<uint32_t, 256> cell_quota{};
    uint32_t cells_above = 0;

    bool cellAbove(uint32_t cell) const { return cell_count[cell] > cell_quota[cell]; }

    void killFace(uint32_t f) {
        face[f].meta |= 1u << 31;
        const uint32_t cell = face[f].cell();
        if (cell_count[cell]-- == cell_quota[cell] + 1) --cells_above;
    }

    /// note: stamps of living vertices stay far below, so a sum with a dead one is never theirs.
    static constexpr uint32_t kDeadStamp = 1u << 30;

    void killVertex(uint32_t v) {
        point[v].flags |= kDeadFlag;
        stamp[v] += kDeadStamp;
    }

    /// The vertex that `v` is part of by now.
    uint32_t root(uint32_t v) {
        while (parent[v] != v) v = parent[v] = parent[parent[v]];
        return v;
    }

    Vec3i latticePosition(uint32_t v) const {
        const Point& p = point[v];
        return centre + Vec3i(int32_t(p.x), int32_t(p.y), int32_t(p.z));
    }

private:
    void buildFans();
};

}  // namespace pietra
