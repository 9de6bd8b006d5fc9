#include "coarsen/input_leaves.h"

#include "base/error.h"
#include "coarsen/crumbs.h"
#include "coarsen/diamond.h"
#include "coarsen/precision.h"

namespace pietra {

namespace {

constexpr const char* kStoreName = "leaves";

struct LeafBlob {
    CellId cell;
    CellBlob blob;
};

}  // namespace

MemoryPlan::MemoryPlan(size_t limit, int jobs, size_t corner_bytes) {
    constexpr size_t kProgram = size_t(48) << 20;
    constexpr size_t kLeast = size_t(64) << 20;
    budget = std::max(limit, kProgram + kLeast) - kProgram;
    work = std::min(budget * 3 / 4, std::max(budget / 3, size_t(jobs) * (size_t(192) << 20)));
    // A triangle in flight has indices twice, and ahead once more, corners, four cells and an
    // order of its corners.
    const size_t triangle_bytes = 3 * 24 + 3 * corner_bytes + 32 + 12;
    partition.batch_triangles =
        std::clamp(work / 2 / triangle_bytes, size_t(1) << 14, size_t(4) << 20);
    partition.buffer_bytes = std::min(work / 4, size_t(128) << 20);
    // A bucket being welded takes about 200 bytes a triangle.
    partition.bucket_triangles =
        std::max(work / size_t(jobs) / (200 + 3 * corner_bytes), size_t(1) << 14);
}

InputLeaves::InputLeaves(TriangleSource& source, const InputSettings& settings,
                         const MemoryPlan& plan, TempSpace& space, Progress& progress)
    : vertices(source, settings.input_name, settings.precision, space, progress),
      store(space, int(source.schema().scalars.size()), kStoreName) {
    if (settings.precision.kind == PrecisionSetting::Kind::kAuto)
        vertices.setShift(chooseShift(source, vertices, plan.partition.batch_triangles, progress));
    PartitionSettings partition_settings = plan.partition;
    partition_settings.shape = settings.shape;
    Partition partition(source, vertices, partition_settings, space, progress);
    vertices.clear();
    degenerate = partition.degenerateCount();
    if (partition.triangleCount() == 0)
        throw InputError(settings.input_name, "",
                         degenerate > 0 ? "there is nothing to show: all triangles are degenerate"
                                        : "there is nothing to show: there are no triangles");
    LeafSettings leaf_settings;
    leaf_settings.leaf_triangles = settings.leaf_triangles;
    leaf_settings.bound = vertices.quantisationError();
    leaf_settings.component_bytes = plan.work / 16;
    leaf_settings.mark_irregular = settings.mark_irregular;
    const VertexRecord record(source.schema());
    leaves = buildLeaves(partition, record, leaf_settings, space, store, progress);
    if (settings.shape == CellShape::kTetrahedra)
        moveCrumbs(leaves, store, std::min(kSmallestPatch, settings.leaf_triangles / 8), progress);
}

InputLeaves::InputLeaves(const AttributeSchema& schema, TempSpace& space, StateReader& state)
    : vertices(schema, space, state), store(space, int(schema.scalars.size()), kStoreName) {
    state.get(degenerate);
    store.restore(state);
    leaves.tree = std::make_unique<CellTree>(state);
    std::vector<LeafBlob> blobs;
    state.get(blobs);
    for (auto& [cell, blob] : blobs) {
        blob.store = &store;
        leaves.blobs.emplace(cell, blob);
    }
    state.get(leaves.triangles);
    state.get(leaves.duplicates);
    state.get(leaves.edges);
}

void InputLeaves::save(StateWriter& state) {
    vertices.save(state);
    state.put(degenerate);
    store.save(state);
    leaves.tree->save(state);
    std::vector<LeafBlob> blobs;
    for (const auto& [cell, blob] : leaves.blobs) blobs.push_back({cell, blob});
    state.put(blobs);
    state.put(leaves.triangles);
    state.put(leaves.duplicates);
    state.put(leaves.edges);
}

}  // namespace pietra
