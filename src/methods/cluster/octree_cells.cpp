#include "methods/cluster/octree_cells.h"

#include <algorithm>

#include "geometry/lattice.h"
#include "geometry/morton.h"

namespace pietra::cluster {

namespace {

/// The first codes of the cells, increasing.
class CellDivision {
public:
    CellDivision(std::vector<uint64_t> codes, size_t most) : codes_(std::move(codes)), most_(most) {
        std::sort(codes_.begin(), codes_.end());
        divide(0, codes_.size(), 0, 3 * kLatticeBits);
    }
    uint32_t cellAt(uint64_t code) const {
        return uint32_t(std::upper_bound(first_.begin(), first_.end(), code) - first_.begin() - 1);
    }
    uint32_t count() const { return uint32_t(first_.size()); }

private:
    void divide(size_t begin, size_t end, uint64_t first, int bits) {
        if (end - begin <= most_ || bits == 0) {
            first_.push_back(first);
            return;
        }
        bits -= 3;
        for (uint64_t child = 0; child < 8; ++child) {
            const uint64_t child_first = first + (child << bits);
            const auto child_end =
                std::lower_bound(codes_.begin() + ptrdiff_t(begin), codes_.begin() + ptrdiff_t(end),
                                 child_first + (uint64_t(1) << bits));
            divide(begin, size_t(child_end - codes_.begin()), child_first, bits);
            begin = size_t(child_end - codes_.begin());
        }
    }
    std::vector<uint64_t> codes_;
    size_t most_;
    std::vector<uint64_t> first_;
};

}  // namespace

CellTriangles octreeCells(const Mesh& mesh, uint32_t most_vertices) {
    std::vector<uint64_t> codes;
    for (const Vec3i& p : mesh.position) codes.push_back(mortonCode(p));
    const CellDivision division(codes, most_vertices);
    std::vector<uint32_t> cell_of(mesh.vertexCount());
    for (size_t v = 0; v < cell_of.size(); ++v) cell_of[v] = division.cellAt(codes[v]);

    std::vector<std::vector<std::pair<uint64_t, uint32_t>>> sorted(division.count());
    for (uint32_t t = 0; t < mesh.triangleCount(); ++t) {
        const auto [a, b, c] = mesh.triangle[t];
        const uint32_t cell = std::max({cell_of[a], cell_of[b], cell_of[c]});
        const Vec3i middle = (mesh.position[a] + mesh.position[b] + mesh.position[c]) / 3;
        sorted[cell].push_back({mortonCode(middle), t});
    }
    CellTriangles cells;
    for (auto& triangles : sorted) {
        if (triangles.empty()) continue;
        std::sort(triangles.begin(), triangles.end());
        auto& list = cells.of_cell.emplace_back();
        for (const auto& [code, t] : triangles) list.push_back(t);
    }
    return cells;
}

}  // namespace pietra::cluster
