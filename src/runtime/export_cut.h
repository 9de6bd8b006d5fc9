#pragma once
// The triangles of a cut, from a model file to a mesh file, in bounded memory.
//
// Patches are written in the order of their nodes. A vertex that patches share is written once:
// open vertices of a patch (whose triangles do not close around them) are remembered by position
// and attributes as long as the budget lasts; when it is used up, what is remembered is dropped,
// and vertices on later borders with older patches come again (`repeated`). Vertices that no
// triangle uses are left out. Deterministic, for equal budgets.

#include <cstdint>

#include "base/budget.h"
#include "base/progress.h"
#include "io/mesh_writer.h"
#include "multires/cut.h"
#include "store/model_reader.h"

namespace pietra {

struct ExportReport {
    uint64_t triangles = 0;
    uint64_t vertices = 0;
    bool repeated = false;  ///< memory ran out: some border vertices may be there several times
};

/// How the mesh file of a cut of this model is to be opened.
MeshOutput meshOutputOf(const ModelReader& model);

/// Writes the cut and finishes the file. `progress`: a stage the caller has begun; ticks once a
/// node. At most `in_flight` pages are decoded ahead.
ExportReport exportCut(const ModelReader& model, const Cut& cut, MeshWriter& writer, Budget& budget,
                       size_t in_flight, Progress& progress);

}  // namespace pietra
