#pragma once
// Second half of the partition: the triangles of one bucket, welded into an indexed mesh in path
// order, with the class of every edge and the normal of every vertex as the *whole* input has them.
//
// A bucket sees all triangles around the vertices in its own cell (partition.h), so it knows the
// truth about those vertices, and about the edges whose smaller end point lies there. What
// other buckets must learn of that (a normal, an edge that is no ordinary one) goes to them as
// messages, and to which components its triangles belong goes to a table (components.h).
// weldBucket() makes mesh and messages; applyMessages() completes a mesh. Pure functions:
// buckets in parallel, in any order, all of the first before any of the second.

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "coarsen/components.h"
#include "coarsen/partition.h"
#include "geometry/mesh.h"

namespace pietra {

struct BucketMesh {
    Mesh mesh;                       ///< triangles in path order; scalar as in the schema
    std::vector<uint8_t> is_inside;  ///< per vertex: it lies in the bucket's cell
    BucketComponents components;     ///< of the triangles
};

/// What the bucket that owns a vertex or an edge tells another that uses it.
struct Message {
    uint64_t a;      ///< key of the vertex, or of the edge's smaller end
    uint64_t b;      ///< key of the edge's larger end, or kVertex
    uint32_t value;  ///< the normal's bits, or the EdgeClass
    uint32_t pad = 0;
    static constexpr uint64_t kVertex = ~uint64_t(0);
};

/// A cell that holds at most the leaf maximum of triangles while its parent holds more; a cube may
/// hold less.
struct LeafCell {
    CellId cell;
    uint32_t triangles;
    uint64_t occupied;  ///< bit i: the cell's i-th descendant six levels down has triangles
};

struct EdgeCounts {
    uint64_t border = 0, non_manifold = 0, inconsistent = 0;
    void operator+=(const EdgeCounts& o) {
        border += o.border;
        non_manifold += o.non_manifold;
        inconsistent += o.inconsistent;
    }
};

struct WeldedBucket {
    BucketMesh bucket;
    std::vector<std::pair<size_t, Message>> messages;  ///< with the bucket each goes to
    std::vector<LeafCell> leaves;                      ///< in path order
    uint64_t duplicates = 0;                           ///< triangles dropped: same three corners
    EdgeCounts edges;                                  ///< of the edges that this bucket owns
};

/// `mark_irregular`: for each fan at a vertex where triangles do not form one fan (a run joined by
/// edges that two triangles use, in opposite directions), one edge there is of class kMany. So no
/// collapse moves such a vertex, wherever its other fans are.
WeldedBucket weldBucket(const Partition& partition, size_t bucket, const VertexRecord& record,
                        uint32_t leaf_triangles, bool mark_irregular = false);

/// Sets normals and edge classes that other buckets know better.
void applyMessages(std::span<const Message> messages, BucketMesh& bucket);

CellPath trianglePath(const Mesh& mesh, size_t triangle, CellShape shape = CellShape::kTetrahedra);

}  // namespace pietra
