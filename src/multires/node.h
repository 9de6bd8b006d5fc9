#pragma once
// The multiresolution contract, part one: nodes, their error, and the cut rule.
//
// A model is a table of nodes. A node is the unit of refinement on disk: it has one patch (a small
// mesh) and two children, or a range of them, whose patches together replace it. Nodes of one
// `group` (a diamond of Adaptive TetraPuzzles) are refined only together: they have equal `error`
// and equal `saturated` sphere, so every criterion that depends on these two alone treats them
// alike; likewise `face_size`. Parents' errors and face sizes are at least their children's, and
// parents' saturated spheres enclose their children's, hence any criterion that is monotone in
// (error or face size, sphere) selects a valid, crack-free cut.
//
// Parts that are refined independently of each other are joined where one is finer than the other
// (docs/design/cluster.md): a *joint* is a child of the finer side's parent, and of the group of
// the coarser side. It is drawn while its parent is refined and its group is not, so it has the
// group's error and sphere, and when the group is refined, nothing takes its place. What it adds
// lies in the page of its siblings. Source: Cignoni et al. 2004, sections 3 and 4. Units: lattice
// units (geometry/lattice.h).

#include <cstdint>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "geometry/bounds.h"
#include "geometry/lattice.h"
#include "geometry/mesh.h"

namespace pietra {

using NodeIndex = uint32_t;
inline constexpr NodeIndex kNoNode = std::numeric_limits<NodeIndex>::max();

struct Node {
    Sphere bounds;     ///< tight: encloses this node's patch
    Sphere saturated;  ///< encloses all geometry of the group and of everything finer below it
    float error = 0;   ///< proven two-sided distance to the input, monotone, the same in the group
    /// Square root of the mean area of its faces, as its method counts them, monotone, the same in
    /// the group. 0: not known (ModelInfo::face_sizes).
    float face_size = 0;
    NormalCone cone;                          ///< of this patch's triangle normals
    NodeIndex child[2] = {kNoNode, kNoNode};  ///< kNoNode: none; a leaf and a joint have none
    uint32_t group = 0;                       ///< number of the diamond, unique in the model
    uint32_t page = 0;                        ///< which page holds the patch
    uint16_t patch = 0;                       ///< which patch of that page
    uint16_t level = 0;                       ///< depth in the hierarchy; roots are 0
    uint32_t triangles = 0;                   ///< of the patch
    uint32_t vertices = 0;                    ///< of the patch
    bool closed = false;       ///< belongs to closed, consistently oriented components only: may be
                               ///< culled by its cone, drawn one-sided
    bool child_range = false;  ///< its children are all nodes from child[0] to child[1]
    bool is_joint = false;
    /// Nothing finer may take its place.
    bool isLeaf() const { return child[0] == kNoNode && child[1] == kNoNode && !is_joint; }
    /// visit(child), in order.
    template <class Visit>
    void forEachChild(Visit&& visit) const {
        if (child_range)
            for (NodeIndex i = child[0]; i <= child[1]; ++i) visit(i);
        else
            for (const NodeIndex i : child)
                if (i != kNoNode) visit(i);
    }
};

/// What a model says about itself, as stored in the file's header.
struct ModelInfo {
    std::string method;  ///< "tetra"
    Lattice lattice;
    AttributeSchema schema;
    uint64_t input_triangles = 0;
    uint64_t input_vertices = 0;
    uint32_t input_files = 0;
    uint64_t dropped_degenerate = 0;
    uint64_t dropped_duplicate = 0;
    float quantisation_error =
        0;         ///< bound of the lattice snap, lattice units; part of every error
    Box3i bounds;  ///< lattice units
    uint32_t levels = 0;
    uint64_t triangles_stored = 0;
    bool face_sizes = false;  ///< nodes say how large their faces are
};

}  // namespace pietra
