#pragma once
// K-means face clustering (Wu and Huang 2014, figure 1): K regions; each is known by its mean
// plane; faces at its border go to the neighbour that they cost least (as Valette and Chassery,
// 2004, move them, which is several times as fast as growing all regions anew); until that settles.
// Some regions come later, where others bend most. In the end regions grow once more from the faces
// that stand for them best, over the dual graph, always where it costs least, as discs with simple
// outlines: what would close a ring or touch its own region is refused, and left to others, or
// becomes a region of its own.
//
// A function of the mesh alone. Rounds are linear; growing is n log n in the regions' borders, 8
// bytes a waiting face.

#include "methods/cluster/polygon_mesh.h"

namespace pietra::cluster {

struct ClusterSettings {
    int most_rounds = 5;  ///< of choosing representatives; after the last one regions become discs
    /// Of the regions, this share is there at first. The others begin, an equal share each round,
    /// at the faces farthest from their region's plane.
    float first_share = 0.75f;
    /// Cost of a face for a region: squared distance of the centroids, plus this times that across
    /// the region's plane, ...
    float plane_weight = 64;
    /// ... plus this times the mean area of a region times (1 - cosine of the normals).
    float normal_weight = 16;
};

/// About `count` regions. Faces should be in an order in which those that are near each other lie
/// together: first representatives are taken from it at equal steps; groups come in that order.
Groups clusterFaces(const PolygonMesh& mesh, uint32_t count, const ClusterSettings& settings = {});

}  // namespace pietra::cluster
