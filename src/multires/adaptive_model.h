#pragma once
// The multiresolution contract for methods whose pages are not patches (node.h) but operations on
// one mesh: a cut of such a model is a mesh as a whole, not a choice of nodes. This is its offline
// side, for `extract` and `check`; a method makes one from an open file (method.h).

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/budget.h"
#include "geometry/mesh.h"
#include "multires/view.h"

namespace pietra {

/// How fine a cut is to be: one of these, or none for the finest.
struct CutRequest {
    std::optional<double> max_error;        ///< as coarse as may be; lattice units
    std::optional<uint64_t> max_triangles;  ///< the one of least error
    std::optional<View> view;               ///< what shows as more than `pixels` is refined
    double pixels = 1;
};

struct MeshCut {
    Mesh mesh;                  ///< lattice units; edge classes are not set
    double max_error = 0;       ///< the largest that is stated of a part of it, lattice units
    std::vector<float> error;   ///< one a triangle: what is stated of it, at most that
    bool below_finest = false;  ///< asked for less error than the finest states; this is that
    bool over_budget = false;   ///< even the coarsest has more triangles; this is that
};

class AdaptiveModel {
public:
    virtual ~AdaptiveModel() = default;
    /// A sentence about what is wrong with a page by itself and with those next to it, or empty.
    /// Thread-safe; takes the memory of a few pages.
    virtual std::string pageFault(uint32_t page) const = 0;
    /// The same of the model as a whole, whose pages have no faults. This and the next one load the
    /// model and keep it in memory: MemoryError where the budget has less than they need,
    /// InputError for a damaged file. The budget must outlive this object. Not thread-safe.
    virtual std::string modelFault(Budget& budget) = 0;
    virtual MeshCut cut(const CutRequest& request, Budget& budget) = 0;
};

}  // namespace pietra
