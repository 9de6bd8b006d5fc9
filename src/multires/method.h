#pragma once
// The multiresolution contract, part two: what a method is to the rest of the house. A method is
// one row of the table in methods/method_table.h; nothing above src/methods knows its name.

#include <cstdint>
#include <memory>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/budget.h"
#include "base/progress.h"
#include "geometry/lattice.h"
#include "io/triangle_source.h"
#include "multires/adaptive_model.h"
#include "multires/live_model.h"

namespace pietra {

/// What a build is asked for.
struct BuildSettings {
    std::string output;
    bool force = false;       ///< overwrite `output`
    size_t memory_bytes = 0;  ///< bound of the process's resident set
    int jobs = 1;             ///< threads
    std::string temp_dir;     ///< existing directory for temporary data
    PrecisionSetting precision;
    uint32_t leaf_triangles = 4000;   ///< most triangles of a leaf
    uint32_t patch_triangles = 2000;  ///< coarse patches are about this large
    std::string input_name;           ///< for messages
    uint32_t input_files = 1;
    /// What tells the input's files from all others, and from what they were before they changed;
    /// empty: nothing is kept when the build is interrupted.
    std::string input_identity;
    bool resume = false;            ///< go on where another build was interrupted
    double checkpoint_seconds = 5;  ///< of work that may be lost, at least
};

/// What it did. Bytes and seconds.
struct BuildReport {
    uint64_t input_triangles = 0, input_vertices = 0;
    uint64_t dropped_degenerate = 0, dropped_duplicate = 0;
    uint64_t stored_triangles = 0, nodes = 0;
    uint32_t levels = 0;
    bool resumed = false;
    uint64_t temp_bytes_peak = 0, output_bytes = 0;
    uint64_t border_edges = 0, non_manifold_edges = 0, inconsistent_edges = 0;
    std::vector<std::string> notes;  ///< sentences for the user
};

struct Method {
    const char* name;     ///< as in --method and in the file
    const char* summary;  ///< one line for --help
    /// Builds a model file from a source. Throws the errors of base/error.h; leaves nothing behind
    /// when it does, but what resuming takes (construction/checkpoint.h). Stays within
    /// settings.memory_bytes. Output bytes depend on the input, the precision and the patch sizes
    /// alone.
    BuildReport (*build)(TriangleSource& source, const BuildSettings& settings, Progress& progress);
    /// Errors are proven bounds of the distance to the input; else estimates.
    bool proven;
    /// Null for a method whose pages are patches, of which the house makes cuts itself. The reader,
    /// of a file of this method, must outlive the result. Throws InputError.
    std::unique_ptr<AdaptiveModel> (*open)(const ModelReader& reader) = nullptr;
    /// Likewise, and goes with it: to be looked at.
    OpenLive open_live = nullptr;
};

}  // namespace pietra
