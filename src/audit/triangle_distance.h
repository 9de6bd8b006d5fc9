#pragma once
// Exact distance from points to one triangle, prepared once for many points. Double throughout. For
// corners on the integer lattice the normal is exact and the error of a distance stays below 1e-8
// lattice units. Segments and points as degenerate triangles are fine.

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "geometry/vec.h"

namespace pietra {

/// Corners in lattice coordinates, not necessarily integers.
using TriangleCorners = std::array<Vec3d, 3>;

class TriangleDistance {
public:
    explicit TriangleDistance(const TriangleCorners& corners) : corner_(corners) {
        double longest_sq = 0;
        for (int k = 0; k < 3; ++k) {
            edge_[k] = corner_[(k + 1) % 3] - corner_[k];
            const double length_sq = glm::dot(edge_[k], edge_[k]);
            inverse_sq_[k] = length_sq > 0 ? 1 / length_sq : 0;
            longest_sq = std::max(longest_sq, length_sq);
        }
        normal_ = glm::cross(edge_[0], edge_[1]);
        const double normal_sq = glm::dot(normal_, normal_);
        flat_ = !(normal_sq > 0);
        if (flat_) return;
        inverse_normal_ = 1 / std::sqrt(normal_sq);
        for (int k = 0; k < 3; ++k) inward_[k] = glm::cross(normal_, edge_[k]);
        // A sliver's normal may be off, but then its edges are a good answer: see distance().
        const double height_sq = normal_sq / longest_sq;
        sliver_height_ = height_sq < 1e-10 * longest_sq ? std::sqrt(height_sq) : -1;
    }

    double distance(const Vec3d& p) const {
        if (flat_ || !isAbove(p)) return distanceToEdges(p);
        const double to_plane = std::abs(glm::dot(normal_, p - corner_[0])) * inverse_normal_;
        if (sliver_height_ < 0) return to_plane;
        // No point of the triangle is further from its edges than its height.
        const double to_edges = distanceToEdges(p);
        return std::clamp(to_plane, std::max(0.0, to_edges - sliver_height_), to_edges);
    }

private:
    bool isAbove(const Vec3d& p) const {
        for (int k = 0; k < 3; ++k)
            if (glm::dot(inward_[k], p - corner_[k]) < 0) return false;
        return true;
    }

    double distanceToEdges(const Vec3d& p) const {
        double least_sq = std::numeric_limits<double>::infinity();
        for (int k = 0; k < 3; ++k) {
            const Vec3d d = p - corner_[k];
            const double t = std::clamp(glm::dot(d, edge_[k]) * inverse_sq_[k], 0.0, 1.0);
            const Vec3d rest = d - t * edge_[k];
            least_sq = std::min(least_sq, glm::dot(rest, rest));
        }
        return std::sqrt(least_sq);
    }

    std::array<Vec3d, 3> corner_, edge_, inward_;  // inward_: in the plane, across the edge
    std::array<double, 3> inverse_sq_;
    Vec3d normal_;
    double inverse_normal_ = 0;
    double sliver_height_ = -1;
    bool flat_ = false;
};

}  // namespace pietra
