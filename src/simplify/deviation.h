#pragma once
// The proven two-sided error bound of one simplification step (docs/design/error.md).
//
// Every face T of a mesh carries two numbers, in lattice units:
//   A(T): the original surface is a union of sets S_T, and every x in S_T lies within A(T) of T;
//   B(T): every y in T lies within B(T) of the original surface.
// Given a mesh with its bounds and a simplified mesh, Deviation computes the bounds of the latter:
//   A: every old face T is covered by pieces (convex polygons), each handed to a new face f:
//      A'(f) = max of A(T) + largest distance of the piece's corners to f;
//   B: every new face T' is covered by pieces, each handed to an old face f:
//      B'(T') = max of B(f) + largest distance of the piece's corners to f.
// Proof: the distance to *one* triangle is a convex function, so over a convex piece it is largest
// at a corner; the pieces cover the face by construction; the triangle inequality adds what the
// face had before. Nothing is assumed about the meshes: no projection, no bijection, no
// manifoldness. The maps from old to new only say where to start looking; where pieces are cut, and
// to whom they go, decides how tight the bound is, never whether it holds.
//
// Deterministic; no dependence on threads or the SIMD level. Memory: scratch of about 150 bytes a
// triangle of the largest input seen, kept between calls. Time: see docs/design/error.md.

#include <cstdint>
#include <functional>
#include <memory>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace pietra {

/// No vertex, no triangle.
inline constexpr uint32_t kNoDeviationIndex = ~0u;

/// The two bounds of each face of a mesh, in lattice units. At level 0: zero, or the largest
/// distance the face's corners were moved by the lattice.
struct FaceBounds {
    std::vector<float> to_original;    ///< A, one a triangle
    std::vector<float> from_original;  ///< B, one a triangle
};

/// One step, borrowed. Spans may hold nonsense (also indices out of range): see above.
struct DeviationInput {
    const Mesh* before = nullptr;  ///< not empty
    const FaceBounds* before_bounds = nullptr;
    const Mesh* after = nullptr;             ///< not empty
    std::span<const uint32_t> vertex_map;    ///< per old vertex: the new vertex it was merged into
    std::span<const uint32_t> triangle_map;  ///< per old triangle: the new one in the same slot
    std::span<const uint8_t> triangle_changed;  ///< per new triangle: 0 if it is the very triangle
                                                ///< that was mapped to it (checked); may be empty
    float child_error = 0;  ///< largest error stated by the children: what stays well below it is
                            ///< accepted without effort
    /// So many of the last faces of either mesh only take pieces: nothing covers them here. A of
    /// such a new face is negative if it took none.
    uint32_t before_takes = 0, after_takes = 0;
    /// Whether such a new face is worth it, given what it took, A of it, and the step's error so
    /// far. One that is not is given up, its A becomes negative, and what it took goes to others.
    /// Asked until no face is given up. None: all are.
    std::function<bool(uint32_t face, float value, float error)> worth = {};
};

/// Owns the scratch memory: one a thread.
class Deviation {
public:
    Deviation();
    ~Deviation();
    Deviation(Deviation&&) noexcept;
    Deviation& operator=(Deviation&&) noexcept;

    /// Fills `after_bounds` (resized to the new mesh) and returns the largest of its values, the
    /// error of the diamond before saturation. All values are rounded up. Throws BugError if a mesh
    /// is empty or sizes disagree.
    float run(const DeviationInput& input, FaceBounds& after_bounds);

    /// How often what was done since construction, for benchmarks.
    struct Counters {
        uint64_t faces = 0;       ///< covered, both directions
        uint64_t general = 0;     ///< of these, not as a height field
        uint64_t overlaps = 0;    ///< of a face with one of the other mesh, as height fields
        uint64_t by_overlap = 0;  ///< of these, accepted by the height over the overlap
        uint64_t pieces = 0;      ///< left for verification
        uint64_t verified = 0;    ///< looked at there
    };
    const Counters& counters() const;

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace pietra
