#pragma once
// What vertices carry besides position and normal: a colour, if the input has colours, and scalars,
// as 32-bit words, exactly as the input has them. A vertex has those of the end of the operation
// that it came from last (or of the base vertex that it is), whole, not as differences: so nobody
// keeps them for active vertices, and coarsening brings back what was.

#include <bit>
#include <cstdint>
#include <span>
#include <vector>

#include "geometry/mesh.h"

namespace pietra::pmesh {

struct WordLayout {
    uint32_t colours = 0;  ///< 0 or 1: the first word
    uint32_t scalars = 0;
    static WordLayout of(const AttributeSchema& schema) {
        return {schema.colours, uint32_t(schema.scalars.size())};
    }
    static WordLayout of(const Mesh& mesh) {
        const size_t vertices = mesh.vertexCount();
        return {!mesh.colour.empty(), vertices ? uint32_t(mesh.scalar.size() / vertices) : 0};
    }
    uint32_t words() const { return colours + scalars; }
    bool operator==(const WordLayout&) const = default;
};

inline void appendWords(const Mesh& mesh, size_t v, WordLayout layout,
                        std::vector<uint32_t>& words) {
    if (layout.colours) words.push_back(std::bit_cast<uint32_t>(mesh.colour[v]));
    for (uint32_t i = 0; i < layout.scalars; ++i)
        words.push_back(std::bit_cast<uint32_t>(mesh.scalar[layout.scalars * v + i]));
}

/// Of a vertex that there is room for.
inline void setVertex(std::span<const uint32_t> words, WordLayout layout, Mesh& mesh, size_t v) {
    if (layout.colours) mesh.colour[v] = std::bit_cast<Rgba8>(words[0]);
    for (uint32_t i = 0; i < layout.scalars; ++i)
        mesh.scalar[layout.scalars * v + i] = std::bit_cast<float>(words[layout.colours + i]);
}

}  // namespace pietra::pmesh
