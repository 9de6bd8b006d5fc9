#pragma once
// What the tests of partition, components and leaves share: small meshes, cut into leaves.

#include <gtest/gtest.h>

#include <array>
#include <memory>
#include <utility>
#include <vector>

#include "coarsen/leaves.h"
#include "coarsen/precision.h"
#include "io/memory_source.h"

namespace pietra {

using Index = std::array<uint64_t, 3>;

struct TestMesh {
    std::vector<Vec3d> positions;
    std::vector<Index> triangles;
};

class PartitionTest : public testing::Test {
public:
    Budget budget_{256 << 20};
    TempSpace space_{testing::TempDir(), &budget_, 64 << 20};
    Progress progress_;

    struct Built {
        Lattice lattice;
        Leaves leaves;
        std::unique_ptr<CellStore> store;
        uint64_t degenerate = 0;
        size_t buckets = 0;
    };
    Built build(const TestMesh& mesh, uint64_t bucket_triangles, uint32_t leaf_triangles,
                size_t batch = 1 << 20, CellShape shape = CellShape::kTetrahedra) {
        MemorySource source(mesh.positions, mesh.triangles);
        VertexTable vertices(source, "test", {}, space_, progress_);
        vertices.setShift(chooseShift(source, vertices, batch, progress_));
        PartitionSettings settings;
        settings.bucket_triangles = bucket_triangles;
        settings.batch_triangles = batch;
        settings.shape = shape;
        Partition partition(source, vertices, settings, space_, progress_);
        Built built;
        built.buckets = partition.buckets().size();
        built.degenerate = partition.degenerateCount();
        built.store = std::make_unique<CellStore>(space_, 0);
        built.leaves = buildLeaves(partition, vertices.record(), {leaf_triangles, 0.5f}, space_,
                                   *built.store, progress_);
        built.lattice = vertices.lattice();
        return built;
    }
};

}  // namespace pietra
