#pragma once
// Layers out of core (Wu and Huang 2014, section 5): from the leaves of the octree to its root, one
// layer of the whole model at a time. Each layer takes two passes over the cells that get it, in
// parallel: first all report what may leave their interfaces (interface_table.h); then each makes
// its layer, and the nodes of the layer below are written, children of one node side by side with
// the joints among them, so that the file does not depend on who was first.
//
// Memory: the interfaces' table and some cells a thread; layers wait in the temporary space.

#include "construction/construction.h"
#include "methods/cluster/face_clusters.h"

namespace pietra::cluster {

struct BuilderSettings {
    uint32_t leaf_triangles = 8000;
    uint32_t first_faces = 12;  ///< triangles in a super face of the first layer
    uint32_t faces = 3;         ///< super faces of a layer in one of the next
    ClusterSettings clustering;
    int shift = 0;
    AttributeSchema schema;
    float quantisation_error = 0;  ///< what the leaves state, lattice units
    int jobs = 1;
};

struct BuilderCounts {
    uint32_t levels = 0;
    uint64_t triangles = 0;  ///< stored, over all levels
};

/// Goes on from the last layer that was saved, where there is one.
BuilderCounts buildLayers(Construction& work, const BuilderSettings& settings, Progress& progress);

}  // namespace pietra::cluster
