#pragma once
// Makes one mesh of parts of others: vertices at one position become one, the first that came.

#include "coarsen/key_map.h"
#include "geometry/lattice.h"
#include "geometry/mesh.h"

namespace pietra {

/// Appends vertex `v` with all that it carries.
inline void copyVertex(const Mesh& from, uint32_t v, Mesh& to) {
    const size_t scalars = from.scalar.size() / from.vertexCount();
    to.position.push_back(from.position[v]);
    to.normal.push_back(from.normal[v]);
    if (!from.colour.empty()) to.colour.push_back(from.colour[v]);
    for (size_t s = 0; s < scalars; ++s) to.scalar.push_back(from.scalar[v * scalars + s]);
}

class MeshJoiner {
public:
    /// Starts on a mesh, which may have vertices already. `vertices`: about how many will come.
    void begin(Mesh& to, size_t vertices) {
        to_ = &to;
        ids_.reserve(vertices + to.vertexCount());
        for (uint32_t v = 0; v < to.vertexCount(); ++v) ids_.insert(latticeKey(to.position[v]), v);
    }

    /// The number in the joined mesh of vertex `v` of `from`.
    uint32_t addVertex(const Mesh& from, uint32_t v) {
        const auto [id, is_new] =
            ids_.insert(latticeKey(from.position[v]), uint32_t(to_->vertexCount()));
        if (is_new) copyVertex(from, v, *to_);
        return id;
    }

    void addTriangle(const Mesh& from, size_t t) {
        Triangle triangle;
        for (size_t k = 0; k < 3; ++k) triangle[k] = addVertex(from, from.triangle[t][k]);
        to_->triangle.push_back(triangle);
        to_->edge_class.push_back(from.edge_class[t]);
    }

private:
    KeyMap ids_;
    Mesh* to_ = nullptr;
};

}  // namespace pietra
