#include "coarsen/cell_path.h"

#include <algorithm>
#include <utility>

#include "base/check.h"

namespace pietra {

namespace {

// Root r holds the points whose coordinates are in descending order along axes kAxes[r]; ties fall
// to the first of these orders that fits.
constexpr std::array<std::array<int, 3>, 6> kAxes = {
    {{0, 1, 2}, {0, 2, 1}, {1, 0, 2}, {1, 2, 0}, {2, 0, 1}, {2, 1, 0}}};

int rootOf(const Vec3i& p) {
    for (int root = 0; root < 6; ++root) {
        const auto& axes = kAxes[size_t(root)];
        if (p[axes[0]] >= p[axes[1]] && p[axes[1]] >= p[axes[2]]) return root;
    }
    return 0;
}

// Vectorised over kLanes points: three bisections a round, each folding the second child onto the
// first, after which the cell is again the Kuhn simplex x1 >= x2 >= x3 of half the size.
constexpr int kLanes = 8;

struct Lanes {
    int32_t x1[kLanes], x2[kLanes], x3[kLanes], edge[kLanes];
    uint32_t bits[kLanes];
};

inline void bisectThrice(Lanes& s) {
    for (int k = 0; k < kLanes; ++k) {
        int32_t x1 = s.x1[k], x2 = s.x2[k], x3 = s.x3[k];
        const int32_t edge = s.edge[k];
        const bool first = x1 + x3 >= edge;
        const int32_t a1 = first ? edge - x3 : x1, a2 = first ? edge - x2 : x2;
        const int32_t a3 = first ? edge - x1 : x3;
        const bool second = a1 + a2 >= edge;
        const int32_t b1 = second ? edge - a2 : a1, b2 = second ? edge - a1 : a2;
        const bool third = 2 * b1 >= edge;
        s.x1[k] = third ? edge - b1 : b1;
        s.x2[k] = b2;
        s.x3[k] = a3;
        s.edge[k] = edge / 2;
        s.bits[k] = s.bits[k] << 3 | uint32_t(first) << 2 | uint32_t(second) << 1 | uint32_t(third);
    }
}

}  // namespace

CellPath cellPath(const Vec3i& p, int scale, int level) {
    const int root = rootOf(p);
    const auto& axes = kAxes[size_t(root)];
    int32_t x1 = p[axes[0]], x2 = p[axes[1]], x3 = p[axes[2]];
    int32_t edge = scale << kLatticeBits;
    uint64_t bits = uint64_t(root);
    for (int done = 0; done < level; ++done) {
        bool second;
        switch (done % 3) {
            case 0:
                if ((second = x1 + x3 >= edge)) {
                    std::swap(x1, x3);
                    x1 = edge - x1, x2 = edge - x2, x3 = edge - x3;
                }
                break;
            case 1:
                if ((second = x1 + x2 >= edge)) {
                    std::swap(x1, x2);
                    x1 = edge - x1, x2 = edge - x2;
                }
                break;
            default:
                if ((second = 2 * x1 >= edge)) x1 = edge - x1;
                edge /= 2;
        }
        bits = bits << 1 | uint64_t(second);
    }
    return bits << (61 - level);
}

void cellPaths(std::span<const Vec3i> points, int scale, std::span<CellPath> paths, int level) {
    CHECK_EQ(points.size(), paths.size());
    static_assert(kMaxCellLevel % 3 == 0);
    constexpr int kRoundsAWord = 10;
    const int rounds = (level + 2) / 3;
    for (size_t begin = 0; begin < points.size(); begin += kLanes) {
        const size_t count = std::min(size_t(kLanes), points.size() - begin);
        Lanes s{};
        uint64_t result[kLanes] = {};
        for (size_t k = 0; k < count; ++k) {
            const Vec3i& p = points[begin + k];
            const int root = rootOf(p);
            const auto& axes = kAxes[size_t(root)];
            s.x1[k] = p[axes[0]], s.x2[k] = p[axes[1]], s.x3[k] = p[axes[2]];
            s.edge[k] = scale << kLatticeBits;
            result[k] = uint64_t(root);
        }
        for (int round = 0; round < rounds;) {
            const int end = std::min(round + kRoundsAWord, rounds);
            const int fresh = 3 * (end - round);
            for (; round < end; ++round) bisectThrice(s);
            for (int k = 0; k < kLanes; ++k) {
                result[k] = result[k] << fresh | s.bits[k];
                s.bits[k] = 0;
            }
        }
        for (size_t k = 0; k < count; ++k) paths[begin + k] = result[k] << (61 - 3 * rounds);
    }
}

std::array<Vec3i, 4> cellCorners(CellId cell) {
    const int level = cellLevel(cell);
    const auto& axes = kAxes[size_t(cell >> level & 7)];
    std::array<Vec3i, 4> v{};
    for (int k = 1; k <= 3; ++k) {
        v[size_t(k)] = v[size_t(k - 1)];
        v[size_t(k)][axes[size_t(k - 1)]] = 1 << kLatticeBits;
    }
    for (int done = 0; done < level; ++done) {
        const bool second = cell >> (level - 1 - done) & 1;
        switch (done % 3) {
            case 0: {
                const Vec3i m = (v[0] + v[3]) / 2;
                v = second ? std::array{v[3], v[2], v[1], m} : std::array{v[0], v[1], v[2], m};
                break;
            }
            case 1: {
                const Vec3i m = (v[0] + v[2]) / 2;
                v = {second ? v[2] : v[0], v[1], m, v[3]};
                break;
            }
            default: {
                const Vec3i m = (v[0] + v[1]) / 2;
                v = {second ? v[1] : v[0], m, v[2], v[3]};
            }
        }
    }
    return v;
}

namespace {

/// Twice the midpoint of the refinement edge.
Vec3i refinementEdgeSum(CellId cell) {
    const std::array<Vec3i, 4> v = cellCorners(cell);
    return v[0] + v[size_t(3 - cellLevel(cell) % 3)];
}

}  // namespace

uint64_t diamondKey(CellId cell) {
    // Midpoints are even down to kMaxCellLevel, and at most 2^21: halved, they fit 21 bits.
    return latticeKey(refinementEdgeSum(cell) / 4);
}

std::vector<CellId> diamondCells(CellId cell) {
    // All bisecting planes are x = c or x = +-y + c (and permutations). Through the midpoint they
    // cut space into 48 chambers, one for each signed permutation of (3, 2, 1), so a point next to
    // the midpoint in each chamber finds every cell around the refinement edge.
    const int level = cellLevel(cell);
    constexpr int kScale =
        64;  // a point at distance 3/64 of a lattice unit: inside any cell's chamber
    const Vec3i centre = refinementEdgeSum(cell) * (kScale / 2);
    std::vector<CellId> cells;
    for (const auto& axes : kAxes)
        for (int signs = 0; signs < 8; ++signs) {
            Vec3i p = centre;
            for (int k = 0; k < 3; ++k) p[axes[size_t(k)]] += (signs >> k & 1 ? -1 : 1) * (3 - k);
            if (glm::min(p.x, glm::min(p.y, p.z)) < 0) continue;
            if (glm::max(p.x, glm::max(p.y, p.z)) > kScale << kLatticeBits) continue;
            const CellId found = cellAt(cellPath(p, kScale, level), level);
            if (std::find(cells.begin(), cells.end(), found) == cells.end()) cells.push_back(found);
        }
    std::sort(cells.begin(), cells.end());
    return cells;
}

}  // namespace pietra
