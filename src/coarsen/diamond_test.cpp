// One diamond: which cell its triangles end in, and what weighs how much.

#include "coarsen/diamond.h"

#include <gtest/gtest.h>

#include <algorithm>

namespace pietra {
namespace {

struct Store {
    Budget budget{64 << 20};
    TempSpace space{testing::TempDir(), &budget, 0};
    std::unique_ptr<CellStore> cells = std::make_unique<CellStore>(space, 1);
};

/// A flat square of n * n cells with a step in its scalar half-way.
CellMesh squareWithStep(int n) {
    CellMesh cell;
    const int size = 64;
    for (int j = 0; j <= n; ++j)
        for (int i = 0; i <= n; ++i) {
            cell.mesh.position.emplace_back(i * size, j * size, (i * 7 + j * 11) % 5);
            cell.mesh.normal.push_back(encodeNormal({0, 0, 1}));
            cell.mesh.scalar.push_back(2 * i > n ? 1.0f : 0.0f);
        }
    const auto at = [&](int i, int j) { return uint32_t(j * (n + 1) + i); };
    for (int j = 0; j < n; ++j)
        for (int i = 0; i < n; ++i) {
            cell.mesh.triangle.push_back({at(i, j), at(i + 1, j), at(i, j + 1)});
            cell.mesh.triangle.push_back({at(i + 1, j), at(i + 1, j + 1), at(i, j + 1)});
        }
    cell.mesh.edge_class.assign(cell.mesh.triangleCount(), 0);
    cell.bounds.to_original.assign(cell.mesh.triangleCount(), 0.5f);
    cell.bounds.from_original = cell.bounds.to_original;
    return cell;
}

TEST(DiamondWorker, smallCellsJoinLargerOnes) {
    const Store store;
    CellMesh large = squareWithStep(16), small = squareWithStep(16);
    // The last 20 triangles are another cell's.
    large.mesh.triangle.resize(492);
    small.mesh.triangle.erase(small.mesh.triangle.begin(), small.mesh.triangle.begin() + 492);
    for (CellMesh* cell : {&large, &small}) {
        cell->mesh.edge_class.resize(cell->mesh.triangleCount());
        cell->bounds.to_original.resize(cell->mesh.triangleCount());
        cell->bounds.from_original.resize(cell->mesh.triangleCount());
    }
    large.closed = true;
    DiamondInput input;
    input.children = {{store.cells->put(small)}, {store.cells->put(large)}};
    input.quota = {20, 200};
    DiamondOutput output;
    DiamondWorker(0, {1}).run(input, output);
    EXPECT_EQ(output.cells[0].mesh.triangleCount(), 0u);
    EXPECT_EQ(output.cells[1].mesh.triangleCount(), output.output_triangles);
    EXPECT_FALSE(output.cells[1].closed);
}

TEST(DiamondWorker, scalarsCountByTheRangeOfTheWholeInput) {
    const Store store;
    DiamondInput input;
    input.children = {{store.cells->put(squareWithStep(40))}};
    input.quota = {600};
    const auto smeared = [&](float range) {
        DiamondOutput output;
        DiamondWorker(0, {range}).run(input, output);
        const std::vector<float>& scalar = output.cells[0].mesh.scalar;
        return std::count_if(scalar.begin(), scalar.end(),
                             [](float s) { return s > 0.1f && s < 0.9f; });
    };
    EXPECT_LT(3 * smeared(1), smeared(1000));
}

}  // namespace
}  // namespace pietra
