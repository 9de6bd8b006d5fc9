#pragma once
// The cameras of the benchmarks of progressive meshes, at 1920x1080.

#include <cmath>
#include <cstdlib>

#include "geometry/bounds.h"
#include "multires/view.h"

namespace pietra::pmesh {

/// Towards the middle of the box, from so many of its diagonals away.
inline View cameraFrom(const Box3d& box, const Lattice& lattice, double turn, double distance) {
    Camera camera;
    const double size = glm::length(box.max - box.min);
    camera.target = (box.min + box.max) * 0.5;
    camera.eye = camera.target + size * distance * Vec3d(std::cos(turn), std::sin(turn), 0.3);
    return View(camera, {1920, 1080}, lattice);
}

/// To and fro while it circles, eight frames a round.
inline View stormCamera(const Box3d& box, const Lattice& lattice, int frame) {
    const double t = std::abs(frame % 8 - 4) / 4.0;
    return cameraFrom(box, lattice, 0.05 * frame, 0.4 + 1.6 * t);
}

}  // namespace pietra::pmesh
