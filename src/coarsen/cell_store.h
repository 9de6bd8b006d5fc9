#pragma once
// The repository of cells' meshes during construction (Cignoni et al. 2004, section 5): what leaves
// and simplified cells leave behind for the next coarser level, packed, in temporary space.
// Thread-safe.

#include <array>
#include <cstdint>
#include <vector>

#include "base/state.h"
#include "extmem/spill.h"
#include "geometry/mesh.h"
#include "simplify/deviation.h"

namespace pietra {

/// One cell's triangles and, for each, the proven bounds.
struct CellMesh {
    Mesh mesh;
    FaceBounds bounds;
    bool closed = false;  ///< all belong to closed, consistently oriented components
    /// A method's own: a number a corner, one row a triangle; or none.
    std::vector<std::array<uint32_t, 3>> corner{};
};

class CellStore;

/// Where a cell's packed mesh lies.
struct CellBlob {
    const CellStore* store = nullptr;
    uint64_t position = 0;
    uint32_t bytes = 0;
    uint32_t triangles = 0;
};

class CellStore {
public:
    /// `name`: as a spill's.
    CellStore(TempSpace& space, int scalar_count, const std::string& name = "")
        : spill_(space, name), scalar_count_(scalar_count) {}

    CellBlob put(const CellMesh& cell);
    /// Overwrites `cell`, keeping its capacity. `blob` is one of this store.
    void get(const CellBlob& blob, CellMesh& cell) const;
    void clear() { spill_.clear(); }
    /// Blobs remain good, but for their `store`.
    void save(StateWriter& state) {
        spill_.save();
        state.put(spill_.bytes());
    }
    void restore(StateReader& state) { spill_.restore(state.get<uint64_t>()); }

private:
    Spill spill_;
    int scalar_count_;
};

}  // namespace pietra
