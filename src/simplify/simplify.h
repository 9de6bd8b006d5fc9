#pragma once
// The simplifier of Pietra: reduces the merged mesh of one diamond, each of its cells to its own
// number of triangles, by edge collapse on quadrics (Garland, Heckbert 1997; Hoppe 1999 where there
// are colours or scalars; the locks and quotas of Cignoni et al. 2004, section 5.2).
//
// What holds for every output, whatever the input:
//  - Locked vertices are neither moved nor removed, and every edge on the outer border of the
//  diamond
//    is used by as many triangles as before: so two diamonds that share a border still match.
//  - No two vertices have the same position, no triangle has an area of zero that had one before,
//  no
//    two triangles have the same corners.
//  - An edge of class kManifold, kBorder, kTriple that lies inside the diamond is used 2, 1, 3
//  times.
//  - At least one triangle remains, if there was one.
// Without the fallback (see counters) the topology is that of the input.
//
// How: vertices are placed at the quadric's optimum, rounded to the lattice. Collapses are taken
// from one queue for the diamond, and only while one of the cells they take triangles from is above
// its quota. A quadric's cost is a mean distance; what states the error is the largest, so
// collapses that take a vertex far off the surface wait until others cost as much. Where that gets
// stuck, slivers are allowed, small closed-off components are dropped, then vertices are clustered
// on a growing grid.
//
// Deterministic: equal input gives equal bytes, on every machine. Memory: about 100 bytes a
// triangle, kept between runs. Time: about 0.2 microseconds an input triangle.
// A Simplifier serves one thread at a time.

#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace pietra {

class CollapseSink;

/// "No vertex" or "no triangle" in the maps.
inline constexpr uint32_t kNone = 0xffffffffu;

/// Borrowed; must stay alive during run(), and must not be part of the output.
struct SimplifyInput {
    /// Welded: no two vertices at one position. No triangle twice, or with two equal corners.
    /// Normals always, colours and scalars maybe. At least one triangle.
    const Mesh* mesh = nullptr;
    /// One a triangle: its cell in the diamond, below quota.size().
    std::span<const uint8_t> cell;
    /// One a cell, at most 256: triangles to reach. A cell ends at or below its quota but where
    /// locks hinder: it may keep as many more triangles as touch locked vertices. Where topology
    /// hinders too, a quarter more may stay, and three times the quota before vertices are merged
    /// across gaps.
    std::span<const uint32_t> quota;
    /// New vertices are snapped to multiples of 2^shift.
    int shift = 0;
    /// Floats a vertex in mesh->scalar.
    int scalar_count = 0;
    /// Lattice units: the error that the output states at least, whatever is done. Collapses go on
    /// below the quotas where they cost a fraction of it. A component without locked vertices whose
    /// diameter is below it (or below the error reached so far) may be dropped when collapses are
    /// stuck, before clustering begins.
    float free_error = 0;
    /// One a scalar: the width of its range over the whole model, which counts as much as that of a
    /// colour. Empty: its range in this mesh.
    std::span<const float> scalar_range;
    /// Told of each collapse, may forbid it; or null. With a sink there is no fallback: what
    /// collapses do not reach stays.
    CollapseSink* sink = nullptr;
};

struct SimplifyOutput {
    /// Vertices in the order of their first input vertex, triangles in input order.
    Mesh mesh;
    /// One a new triangle.
    std::vector<uint8_t> cell;
    /// One an old vertex: the new vertex it was merged into; kNone where nothing of it is left.
    std::vector<uint32_t> vertex_map;
    /// One an old triangle: the new triangle that is it (the same slot, survived), or kNone.
    std::vector<uint32_t> triangle_map;
    /// One a new triangle: 1 if a corner lies elsewhere than that of the old triangle.
    std::vector<uint8_t> triangle_changed;

    uint32_t collapses = 0;          ///< edges collapsed
    uint32_t clustered = 0;          ///< vertices merged by clustering (the fallback)
    uint32_t dropped_triangles = 0;  ///< triangles of components dropped (the fallback)
    uint32_t locked_vertices = 0;    ///< vertices of the outer border
    /// Estimate of the largest deviation made, in lattice units. Not a bound (deviation.h has
    /// that).
    float estimated_error = 0;
};

class Simplifier {
public:
    Simplifier();
    ~Simplifier();
    Simplifier(Simplifier&&) noexcept;
    Simplifier& operator=(Simplifier&&) noexcept;

    /// Overwrites `output`. Allocates nothing once both have seen a mesh as large.
    void run(const SimplifyInput& input, SimplifyOutput& output);

private:
    struct State;
    std::unique_ptr<State> state_;
};

}  // namespace pietra
