#pragma once
// What `pietra synth` does: writes a generated mesh to a file, in bounded memory.

#include <cstdint>
#include <span>
#include <string>

#include "base/progress.h"

namespace pietra {

struct SynthRequest {
    std::string kind;
    uint64_t triangles = 0;  ///< about so many; 0: the kind's own default. Not for `subdivide`.
    uint64_t seed = 1;
    std::string
        input;       ///< of `subdivide`, a mesh; of `earth`, a netCDF file, "" for ETOPO5's place
    int levels = 1;  ///< of `subdivide`
    double displace = 0.2;  ///< of `subdivide`
};

struct SynthResult {
    uint64_t vertices = 0;
    uint64_t triangles = 0;
    std::vector<std::string> notes;
};

struct SynthKind {
    const char* name;
    const char* about;  ///< one line for --help
};
std::span<const SynthKind> synthKinds();

/// Writes the mesh to `output` (.ply, .obj, .stl, .glb). Throws UsageError (no such kind, bad
/// settings, the file exists and `force` is false), InputError, IoError, Interrupted; then nothing
/// is left.
SynthResult synthesize(const SynthRequest& request, const std::string& output, bool force,
                       Progress& progress);

}  // namespace pietra
