#pragma once
// Vectors are GLM's. Positions on the lattice are Vec3i; input coordinates are Vec3d.

#include <glm/ext/vector_int3_sized.hpp>
#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace pietra {

using Vec2i = glm::ivec2;
using Vec2d = glm::dvec2;
using Vec3i = glm::ivec3;
using Vec3f = glm::vec3;
using Vec3d = glm::dvec3;
using Vec3l = glm::i64vec3;

/// Exact for differences of lattice points.
inline Vec3l crossInteger(const Vec3l& u, const Vec3l& v) {
    return {u.y * v.z - u.z * v.y, u.z * v.x - u.x * v.z, u.x * v.y - u.y * v.x};
}

}  // namespace pietra
