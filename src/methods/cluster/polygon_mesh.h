#pragma once
// One layer of one octree cell: a surface made of polygons, the super faces. Layer 0 is made of the
// input's triangles; each layer above comes from the one below by merging faces to discs and
// leaving vertices of their outlines out (Wu and Huang 2014, section 3; docs/design/cluster.md).
//
// A half-edge is a corner of a face and the edge from there to the next corner. Its twin runs the
// other way round in a neighbour of the same cell. There is none at borders of the input, at
// interfaces to other cells, and where an edge is used otherwise than once in either direction.
//
// Invariants (faultOf()): faces have three corners or more, all different; twins are mutual and
// join the same vertices in opposite directions; an edge is used as often as its class says, less
// only at interfaces; no face is across from itself.

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "geometry/mesh.h"

namespace pietra::cluster {

inline constexpr uint32_t kNone = ~uint32_t(0);

/// Of the input's triangles of which a face is made.
struct FaceShape {
    double area = 0;
    Vec3d moment{0, 0, 0};  ///< centroid times area
    Vec3d normal{0, 0, 0};  ///< of length `area`, where flat
    Vec3d centroid() const { return area > 0 ? moment / area : moment; }
    void add(const FaceShape& o) {
        area += o.area;
        moment += o.moment;
        normal += o.normal;
    }
};

struct PolygonMesh {
    // One a vertex:
    std::vector<Vec3i> position;      ///< lattice units
    std::vector<uint32_t> name;       ///< number in the model
    std::vector<uint8_t> interface_;  ///< other cells use it, too
    std::vector<uint8_t> irregular;   ///< not one fan of faces: edges of other classes, bow-ties
    // One a face:
    std::vector<uint32_t> face_begin = {0};  ///< CSR over half-edges, one more than faces
    std::vector<FaceShape> shape;
    std::vector<uint32_t> middle;  ///< index into inner_*, or kNone
    // One a half-edge:
    std::vector<uint32_t> corner;  ///< the vertex where it begins
    std::vector<uint32_t> face;
    std::vector<uint32_t> twin;
    std::vector<EdgeClass> edge_class;
    // Vertices of the input within a face that nobody else uses, at most one a face:
    std::vector<Vec3i> inner_position;
    std::vector<uint32_t> inner_name;

    uint32_t vertexCount() const { return uint32_t(position.size()); }
    uint32_t faceCount() const { return uint32_t(shape.size()); }
    uint32_t halfEdgeCount() const { return uint32_t(corner.size()); }
    uint32_t corners(uint32_t f) const { return face_begin[f + 1] - face_begin[f]; }
    uint32_t next(uint32_t h) const {
        const uint32_t f = face[h];
        return h + 1 == face_begin[f + 1] ? face_begin[f] : h + 1;
    }
    uint32_t previous(uint32_t h) const {
        const uint32_t f = face[h];
        return h == face_begin[f] ? face_begin[f + 1] - 1 : h - 1;
    }
    uint32_t end(uint32_t h) const { return corner[next(h)]; }
};

/// The half-edges that begin at each vertex.
class Corners {
public:
    explicit Corners(const PolygonMesh& mesh);
    std::span<const uint32_t> at(uint32_t vertex) const {
        return {half_edge_.data() + begin_[vertex], half_edge_.data() + begin_[vertex + 1]};
    }

private:
    std::vector<uint32_t> begin_, half_edge_;
};

/// Layer 0 of a cell. `triangles` has the edge classes of the whole model; `names` are the numbers
/// of its vertices there, `interface` tells which of them other cells use, `irregular` which of
/// them are so in the model.
PolygonMesh polygonsOf(const Mesh& triangles, std::span<const uint32_t> names,
                       std::span<const uint8_t> interface, std::span<const uint8_t> irregular);

/// The groups of faces that are to be one.
struct Groups {
    uint32_t count = 0;
    std::vector<uint32_t> of_face;
};

/// Between different groups, or without a twin.
inline bool separates(const PolygonMesh& mesh, const Groups& groups, uint32_t h) {
    const uint32_t t = mesh.twin[h];
    return t == kNone || groups.of_face[mesh.face[t]] != groups.of_face[mesh.face[h]];
}

/// After separating half-edge `h`, the next one on the outline of its group.
inline uint32_t nextOnOutline(const PolygonMesh& mesh, const Groups& groups, uint32_t h) {
    uint32_t n = mesh.next(h);
    while (!separates(mesh, groups, n)) n = mesh.next(mesh.twin[n]);
    return n;
}

/// A separating half-edge of each group.
std::vector<uint32_t> outlineStarts(const PolygonMesh& mesh, const Groups& groups);

/// Makes each group one face, whose outline keeps the vertices `keep` alone. Groups are discs with
/// simple outlines and keep three vertices or more; all faces around a vertex that an outline
/// leaves out agree, as keep is by vertex. Linear. Faces are in the order of groups.
PolygonMesh mergeFaces(const PolygonMesh& mesh, const Groups& groups,
                       std::span<const uint8_t> keep);

/// A sentence about a broken invariant, or empty. For tests.
std::string faultOf(const PolygonMesh& mesh);

}  // namespace pietra::cluster
