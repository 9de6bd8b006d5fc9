#pragma once
// Lattice points that are nobody's vertices: what a layer may take for anchors that move, and for
// centres of stars that no vertex of the input is. Each is given once. Not thread-safe.

#include <functional>
#include <span>

#include "coarsen/key_map.h"
#include "methods/cluster/layer_step.h"

namespace pietra::cluster {

class FreePoints {
public:
    /// Those within `room`, multiples of 2^shift. `is_used`: of what others have there; may be
    /// empty.
    FreePoints(const Box3i& room, int shift, std::function<bool(const Vec3i&)> is_used = {});

    void occupy(std::span<const Vec3i> points);
    /// Vertices that have moved take the points nearest to where they are, or go back where these
    /// are not free. The layer has one cell's room.
    void settle(LayerStep& step);
    /// Moves the centres of stars that no vertex of the input is to the nearest free points.
    void placeStars(LayerTriangles& triangles);

private:
    bool take(const Vec3i& p);
    Vec3i near(const Vec3i& wanted);

    const Box3i room_;
    const int shift_;
    const std::function<bool(const Vec3i&)> is_used_;
    KeyMap taken_;
};

}  // namespace pietra::cluster
