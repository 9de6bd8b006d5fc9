#pragma once
// What the input must have become: its triangles on the lattice, each once, as a fingerprint, and
// its border edges. Found from the input alone, without any part of the builder, in bounded memory.
//
// A triangle with two corners at one lattice point is degenerate; triangles with the same three
// points are one triangle. An edge used by one triangle only is a border edge.

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "audit/cracks.h"
#include "audit/input_triangles.h"
#include "audit/patch_stream.h"
#include "base/budget.h"
#include "geometry/lattice.h"

namespace pietra {

/// Of a set of triangles: equal for equal sets, and for different ones with a chance of 2^-64. The
/// sum does not depend on the order.
struct SurfaceFingerprint {
    uint64_t triangles = 0;
    uint64_t shape = 0;     ///< of the triangles whichever way they face
    uint64_t oriented = 0;  ///< of the triangles with their orientation
    bool operator==(const SurfaceFingerprint&) const = default;
};

struct InputSurvey {
    uint64_t degenerate = 0;      ///< triangles left out
    uint64_t duplicate = 0;       ///< triangles beyond the first of their kind
    SurfaceFingerprint surface;   ///< of what is left; `oriented` only if nothing is duplicate
    std::vector<EdgeKey> border;  ///< increasing
    Reservation border_memory;    ///< of `border`
};

/// Reads the input's triangles once. Takes `memory_bytes` of `budget` while it works, more than
/// that goes to an unnamed file in `temp_dir`, and 16 bytes for each border edge, which stay.
InputSurvey surveyInput(InputTriangles& input, const Lattice& lattice, Budget& budget,
                        size_t memory_bytes, const std::string& temp_dir);

/// Of the triangles of a cut, with whatever doubles there are.
SurfaceFingerprint fingerprintOfCut(const PatchStream& stream, std::span<const NodeIndex> nodes);

/// The finest cut has the input's triangles, no more and no less; facing the same way, too, where
/// the input has none twice.
bool isSameSurface(const SurfaceFingerprint& finest_cut, const InputSurvey& input);

}  // namespace pietra
