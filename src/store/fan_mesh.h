#pragma once
// The connectivity of any mesh as an oriented manifold with borders. Half-edges a->b and b->a are
// paired where there is exactly one of each; all others are border. Then every vertex is split into
// its fans: runs of triangles around it that are joined by paired edges. A fan vertex is interior
// (its fan closes) or lies on exactly one border loop. Internal to src/store.
//
// Half-edge 4t+k of triangle t starts at its corner k, k < 3; arrays over half-edges have a hole at
// every fourth place. Linear time, deterministic.

#include <cstdint>
#include <vector>

#include "geometry/mesh.h"
#include "store/front_walk.h"

namespace pietra {

inline uint32_t nextHalfEdge(uint32_t h) {
    return (h & 3) == 2 ? h - 2 : h + 1;
}
inline uint32_t previousHalfEdge(uint32_t h) {
    return (h & 3) == 0 ? h + 2 : h - 1;
}

struct FanMesh {
    std::vector<uint32_t> opposite;  ///< of a half-edge, or kNone on a border
    std::vector<uint32_t> corner;    ///< fan vertex from which a half-edge starts
    std::vector<uint32_t> origin;    ///< the mesh's vertex of a fan vertex
    std::vector<uint32_t> valence;   ///< triangles around a fan vertex
    std::vector<uint32_t> border;    ///< the border half-edge that leaves it, or kNone

    /// False if a triangle uses a vertex twice, or no triangle uses some vertex.
    [[nodiscard]] bool build(const Mesh& mesh);

private:
    /// What is known of the half-edges between a vertex in hand and some other one.
    struct Slot {
        uint32_t vertex;    // the one in hand, when this was written
        uint32_t leaving;   // half-edge from it to the other; kNone if there are several
        uint32_t arriving;  // and back; kNone as long as there is none
    };
    void pairHalfEdges(const Mesh& mesh);
    void splitIntoFans(const Mesh& mesh);

    std::vector<uint32_t> first_;    // of a vertex's run in leaving_
    std::vector<uint32_t> leaving_;  // half-edges, by the vertex they leave
    std::vector<Slot> slots_;
};

}  // namespace pietra
