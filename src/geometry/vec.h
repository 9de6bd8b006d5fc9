#pragma once
// Vectors are GLM's. Positions on the lattice are Vec3i; input coordinates are Vec3d.

#include <glm/geometric.hpp>
#include <glm/vec2.hpp>
#include <glm/vec3.hpp>
#include <glm/vec4.hpp>

namespace pietra {

using Vec2i = glm::ivec2;
using Vec3i = glm::ivec3;
using Vec3f = glm::vec3;
using Vec3d = glm::dvec3;

}  // namespace pietra
