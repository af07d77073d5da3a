// Where a point lies in a trilinear hexahedron.
#pragma once

#include <array>
#include <glm/vec3.hpp>
#include <optional>

namespace curvisplat {

/// The hexahedron's local coordinates of a point: -1 to 1 along i, j, k inside it, beyond that outside. By
/// Newton's method; nullopt where that does not converge: far outside, or in a cell without volume. `corner` as
/// Hexahedron takes them. Pure: any thread.
std::optional<glm::dvec3> locateInHexahedron(const std::array<glm::dvec3, 8>& corner,
                                             const glm::dvec3& point);

}  // namespace curvisplat
