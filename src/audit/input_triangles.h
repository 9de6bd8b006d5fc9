#pragma once
// The input's triangles with their positions, in bounded memory: what `check --input` compares a
// model with. Deliberately apart from the builder's own front end, so that one checks the other.
//
// Positions stay in memory if they fit, else they go to one unnamed temporary file and are read
// back through a cache. Triangles whose vertices lie near each other in the file cost little;
// shuffled input costs a read a corner.

#include <array>
#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "base/budget.h"
#include "base/progress.h"
#include "extmem/file.h"
#include "geometry/lattice.h"
#include "io/triangle_source.h"

namespace pietra {

class InputTriangles {
public:
    /// Corners in the input's own coordinates.
    using Corners = std::array<Vec3d, 3>;
    using Visitor = std::function<void(uint64_t first, std::span<const Corners>)>;

    /// Reads all vertices at once. Takes up to `memory_bytes` (1 MiB at least) of `budget`; both
    /// `source` and `budget` must outlive this. Throws what the source throws, IoError,
    /// MemoryError.
    /// `progress` may be null; it is told vertices and triangles as they are read.
    InputTriangles(TriangleSource& source, Budget& budget, size_t memory_bytes,
                   const std::string& temp_dir, Progress* progress = nullptr);

    uint64_t vertexCount() const { return vertex_count_; }
    /// Reads all triangles, in the order of the input; `first` is the number of a batch's first
    /// one. The visitor is called by one thread, with kMaxBatch triangles at most.
    void forEachBatch(const Visitor& visit);

private:
    static constexpr size_t kPageVertices = 128;
    using Page = std::array<Vec3d, kPageVertices>;

    void readVertices();
    const Vec3d& position(uint64_t index);
    const Page& cachedPage(uint64_t page);

    TriangleSource& source_;
    Progress* progress_;
    Reservation reservation_;
    uint64_t vertex_count_;
    std::vector<Vec3d> positions_;  // if they fit
    File file_;                     // else
    std::vector<Page> cache_;
    std::vector<uint64_t> cached_;  // which page each slot holds
};

}  // namespace pietra
