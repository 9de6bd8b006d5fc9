#pragma once
// The triangles of a cut, from a model file to a mesh file, in bounded memory.
//
// Patches are written in the order of their nodes. A vertex that several patches have is written
// once (vertex_numbering.h), with the attributes that it has in the first of them; vertices that no
// triangle uses are left out. So a closed cut is a closed mesh, whoever reads it. The patches are
// read twice. What is written depends on the cut alone.

#include <cstdint>
#include <string>

#include "base/budget.h"
#include "base/progress.h"
#include "io/mesh_writer.h"
#include "multires/cut.h"
#include "store/model_reader.h"

namespace pietra {

struct ExportSettings {
    std::string temp_dir;  ///< for what the budget does not hold
    size_t in_flight = 2;  ///< pages that are decoded ahead, at most
};

struct ExportReport {
    uint64_t triangles = 0;
    uint64_t vertices = 0;
};

/// How the mesh file of a cut of this model is to be opened.
MeshOutput meshOutputOf(const ModelInfo& model, uint64_t triangles);

/// Writes the cut and finishes the file. Takes half of what `budget` has left, and 1.2 bits a
/// vertex; throws MemoryError where that is too little. `progress`: a stage of exportSteps() units
/// that the caller has begun.
ExportReport exportCut(const ModelReader& model, const Cut& cut, MeshWriter& writer,
                       const ExportSettings& settings, Budget& budget, Progress& progress);

/// The same of a mesh in memory, all of whose vertices are written.
ExportReport exportMesh(const ModelInfo& model, const Mesh& mesh, MeshWriter& writer,
                        Progress& progress);

inline uint64_t exportSteps(const Cut& cut) {
    return 2 * cut.nodes.size();
}

}  // namespace pietra
