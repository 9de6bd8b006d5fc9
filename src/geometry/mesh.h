#pragma once
// The indexed triangle mesh that all modules exchange: a patch, a diamond, or a small whole model.
// Positions are on the lattice (geometry/lattice.h). Plain data: no invariants but those stated.

#include <array>
#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/octahedral.h"
#include "geometry/vec.h"

namespace pietra {

/// Three vertex indices, counter-clockwise seen from outside.
using Triangle = std::array<uint32_t, 3>;

struct Rgba8 {
    uint8_t r = 255, g = 255, b = 255, a = 255;
    bool operator==(const Rgba8&) const = default;
};

/// Which attributes a model's vertices carry besides position and normal (every vertex has a
/// normal: computed where the input has none).
struct AttributeSchema {
    bool normals_given = false;  ///< normals come from the input
    bool colours = false;
    std::vector<std::string> scalars;  ///< names, one float a vertex each
    bool operator==(const AttributeSchema&) const = default;
};

/// How many triangles of the *input* meet in an edge. In any valid cut of a model an edge of class
/// kManifold is used exactly twice, kBorder once, kTriple three times, kMany four times or more;
/// anything else is a crack or an overlap.
enum class EdgeClass : uint8_t { kManifold = 0, kBorder = 1, kTriple = 2, kMany = 3 };

struct Mesh {
    std::vector<Vec3i> position;      ///< lattice units
    std::vector<Triangle> triangle;   ///< indices into position
    std::vector<uint8_t> edge_class;  ///< one a triangle: bits 2k, 2k+1 are the EdgeClass of edge
                                      ///< k, which joins corners k and (k+1)%3; bits 6, 7 are zero
    std::vector<OctNormal> normal;  ///< one a vertex
    std::vector<Rgba8> colour;      ///< one a vertex, or empty
    std::vector<float> scalar;      ///< vertex-major, schema.scalars.size() a vertex

    size_t vertexCount() const { return position.size(); }
    size_t triangleCount() const { return triangle.size(); }
    EdgeClass edgeClass(size_t triangle_index, int edge) const {
        return EdgeClass(edge_class[triangle_index] >> (2 * edge) & 3);
    }
    void clear() {
        position.clear();
        triangle.clear();
        edge_class.clear();
        normal.clear();
        colour.clear();
        scalar.clear();
    }
};

}  // namespace pietra
