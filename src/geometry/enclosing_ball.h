#pragma once
// Minimum enclosing balls: exact up to rounding for points (Welzl 1991 with the pivoting of
// Gaertner 1999), within about a thousandth for balls (Badoiu, Clarkson 2003); as Cignoni et al.
// 2004, section 5.2, use them. The spheres returned enclose their input whatever the rounding.
// Deterministic.

#include <span>

#include "geometry/bounds.h"

namespace pietra {

/// Empty (radius -1) for no points. About ten passes over the points.
Sphere enclosingBall(std::span<const Vec3i> points);
Sphere enclosingBall(std::span<const Vec3f> points);
/// Encloses every ball; empty ones are ignored.
Sphere enclosingBall(std::span<const Sphere> balls);

/// Narrow cone around unit normals; cos_angle = -1 where they fill a half-space or more.
NormalCone enclosingCone(std::span<const Vec3f> normals);

}  // namespace pietra
